"""`python -m tumble` is the command `tumble`."""

from tumble.cli import main

if __name__ == "__main__":
    main()
