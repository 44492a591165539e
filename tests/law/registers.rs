//! Inlining of the loops in wide registers by the compiler.

use std::process::Command;

/// A closure that is not inlined has no wide registers, see `lanes`. Each of its operations is a call, which doubles the time of a step.
#[test]
fn nothing_in_wide_registers_is_called() {
    let output = Command::new("nm").arg("--demangle").arg(env!("CARGO_BIN_EXE_dem-mpi")).output();
    let output = output.expect("binutils are there where anything is linked");
    assert!(output.status.success());
    let symbols = String::from_utf8_lossy(&output.stdout);
    assert!(symbols.contains("dem_grains::lanes"), "the program has names");
    let called = |line: &&str| line.contains("core_arch::x86::") && line.contains("::_mm");
    let called: Vec<&str> = symbols.lines().filter(called).collect();
    assert!(called.is_empty(), "{}", called.join("\n"));
}
