// SPDX-License-Identifier: MIT
// libFuzzer target: any bytes as a mesh file end in a valid mesh or in std::runtime_error of one line; what was read
// can be looked over, mended and asked. The first byte chooses the format, and above 127 to go on after reading
// (slower). Build with clang++ -std=c++20 -O1 -fsanitize=fuzzer,address,undefined -I include -I /usr/include/eigen3.

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string_view>

#include <decant/boundary/mesh_repair.hpp>
#include <decant/io/mesh_file.hpp>

#include "survive.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) {
    return 0;
  }
  const std::string_view bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  const auto format = static_cast<decant::MeshFormat>(data[0] % 3);
  survive([&] {
    const decant::TriangleMesh mesh = decant::parse_mesh(bytes, format, "fuzz");
    decant::validate(mesh);
    if (data[0] < 128) {
      return;
    }
    try {
      decant::inspect(mesh, 0.1);
      const decant::TriangleMesh mended = decant::repaired(mesh, 0.1);
      decant::validate(mended);
      const decant::BoundingVolumeHierarchy surface(mended);
      surface.first_hit(surface.bounds().min(), surface.bounds().max());
      surface.closest_point(surface.bounds().center(), 1);
      surface.inside_material(surface.bounds().center());
    } catch (const std::invalid_argument&) {
      // readable, but without any area
    }
  });
  return 0;
}
