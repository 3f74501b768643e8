// SPDX-License-Identifier: MIT
// libFuzzer target: any bytes as scene, motion and series file end in a value or in std::runtime_error of one line.
// Build with clang++ -fsanitize=fuzzer,address,undefined.

#include <cstddef>
#include <cstdint>
#include <string_view>

#include <decant/io/motion_file.hpp>
#include <decant/io/scene.hpp>
#include <decant/io/series_file.hpp>

#include "survive.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  survive([&] { decant::parse_scene(text, "/nonexistent", "fuzz"); });
  survive([&] { decant::parse_motion(text, "fuzz"); });
  survive([&] { decant::parse_series(text, "fuzz"); });
  return 0;
}
