"""Studies of the project itself, a folder each: proofs, measurements and pictures, run by the scripts beside this folder."""
