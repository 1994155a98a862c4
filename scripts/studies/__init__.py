"""Studies of the project itself: benchmark, soak, papers, interoperability, mutants; used by the scripts beside this folder."""
