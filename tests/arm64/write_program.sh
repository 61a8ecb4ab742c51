#!/bin/sh
# Writes programs of this machine that run the `cairn` of another build in an emulator:  write_program.sh BUILD FOLDER
# The system may not know how to run programs of another architecture (binfmt_misc): so `make`, which `cairn compile` starts,
# is told to start this `cairn`.
set -eu
build=$(realpath "$1") folder=$2
mkdir -p "$folder"
folder=$(realpath "$folder")
cat > "$folder/cairn" << END
#!/bin/sh
exec qemu-aarch64-static -L "$build/../sysroot/arm64" "$build/cairn" "\$@"
END
cat > "$folder/make" << END
#!/bin/sh
exec $(command -v make) "\$@" CAIRN="$folder/cairn"
END
chmod +x "$folder/cairn" "$folder/make"
