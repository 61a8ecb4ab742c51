// What tests include, parsed once for all of them (cairn_test); as cmake/precompiled.h, of which sources know
// nothing.

#include "cmake/precompiled.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
