"""The ground under every room: compiling, small algebra, rotations, MuJoCo's C library, files, copies, errors."""
