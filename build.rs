//! How the program is linked.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if std::env::var("CARGO_CFG_TARGET_OS").is_ok_and(|system| system == "linux") {
        // A panic tells its file and line without the tables of symbols, which are a fifth of the file.
        println!("cargo::rustc-link-arg-bin=greybox=-Wl,--strip-all");
    }
}
