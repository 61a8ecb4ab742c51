# Toolchain file: compiles for Debian on 64-bit ARM with Debian's cross compiler, against the packages that `make sysroot`
# unpacks, and runs what it compiled (manual pages, tests) in an emulator:
#   cmake -DCMAKE_TOOLCHAIN_FILE=cmake/arm64.cmake -DCAIRN_BUILD_ROS=OFF ...
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)

set(CAIRN_SYSROOT ${CMAKE_CURRENT_LIST_DIR}/../build/sysroot/arm64 CACHE PATH "Where `make sysroot` unpacked the packages")
# CMake reads this file again for each of its checks of the compiler, which do not have the cache.
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES CAIRN_SYSROOT)
cmake_path(ABSOLUTE_PATH CAIRN_SYSROOT NORMALIZE OUTPUT_VARIABLE CMAKE_SYSROOT)
if(NOT EXISTS ${CMAKE_SYSROOT}/made)
  message(FATAL_ERROR "${CMAKE_SYSROOT} has no packages of arm64; run `make sysroot`")
endif()
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)

set(ENV{PKG_CONFIG_SYSROOT_DIR} ${CMAKE_SYSROOT})
set(ENV{PKG_CONFIG_LIBDIR} ${CMAKE_SYSROOT}/usr/lib/aarch64-linux-gnu/pkgconfig:${CMAKE_SYSROOT}/usr/lib/pkgconfig:${CMAKE_SYSROOT}/usr/share/pkgconfig)
unset(ENV{PKG_CONFIG_PATH})

# pybind11 2.10 would ask this machine's Python what the other one's modules are called and where its headers lie.
file(GLOB python_headers ${CMAKE_SYSROOT}/usr/include/python3.*/Python.h)
get_filename_component(PYTHON_INCLUDE_DIRS "${python_headers}" DIRECTORY)
string(REGEX REPLACE ".*python3\\.(.*)" ".cpython-3\\1-aarch64-linux-gnu.so" PYTHON_MODULE_EXTENSION "${PYTHON_INCLUDE_DIRS}")
set(PYTHONLIBS_FOUND TRUE)

find_program(CAIRN_EMULATOR NAMES qemu-aarch64-static qemu-aarch64)
if(CAIRN_EMULATOR)
  set(CMAKE_CROSSCOMPILING_EMULATOR ${CAIRN_EMULATOR};-L;${CMAKE_SYSROOT})
endif()
