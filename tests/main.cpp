// SPDX-License-Identifier: MIT
// Catch2 2.13 wants its main function compiled once; version 3 brings its own and leaves this file out.
#define CATCH_CONFIG_MAIN
#include <catch2/catch.hpp>
