// SPDX-License-Identifier: MIT
#pragma once

/// The only place that holds decant's version number; CMake, package.xml and vcpkg.json are checked against it.

#define DECANT_VERSION_MAJOR 0
#define DECANT_VERSION_MINOR 1
#define DECANT_VERSION_PATCH 0
#define DECANT_VERSION "0.1.0"
