//! `tumble-bindgen MODULE.wasm NAME FOLDER` writes NAME.js, NAME.d.ts and NAME_bg.wasm for browsers into FOLDER.
//!
//! The command-line tool of wasm-bindgen does the same and takes minutes to build, for a test runner that it brings along.

use std::env;
use std::process::ExitCode;
use wasm_bindgen_cli_support::Bindgen;

fn main() -> ExitCode {
    let [module, name, folder] = &env::args().skip(1).collect::<Vec<_>>()[..] else {
        eprintln!("usage: tumble-bindgen MODULE.wasm NAME FOLDER");
        return ExitCode::from(2);
    };
    let mut bindgen = Bindgen::new();
    bindgen
        .input_path(module)
        .out_name(name)
        .typescript(true)
        .omit_default_module_path(false)
        .remove_name_section(true)
        .remove_producers_section(true);
    match bindgen.web(true).and_then(|web| web.generate(folder)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{module}: {error:#}");
            ExitCode::FAILURE
        }
    }
}
