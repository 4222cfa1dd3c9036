"""Experiments on the methods, each a page to read: which integrator to take, which links make which structure."""
