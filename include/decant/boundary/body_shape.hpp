// SPDX-License-Identifier: MIT
#pragma once

/// What a rigid body is made of, and how the analytic shapes become bodies.

#include <vector>

#include <decant/boundary/shapes.hpp>
#include <decant/boundary/solid_parts.hpp>
#include <decant/boundary/triangle_mesh.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>

namespace decant::inline DECANT_TARGET {

/// A body's shape: its surface, and its solids where it is put together from simple ones (then wall integrals are in
/// closed form; the surface is used for swept contact, sight lines and pictures).
struct BodyShape {
  TriangleMesh mesh{};             ///< [m], in the body's frame
  std::vector<SolidPart> parts{};  ///< empty for a mesh

  BodyShape() = default;

  /// Any mesh. Those from files may need repair first (boundary/mesh_repair.hpp).
  BodyShape(TriangleMesh surface) : mesh(std::move(surface)) {}

  BodyShape(const Box& box) : mesh(box.mesh()), parts{SolidBox{box.min, box.max}} {}
  BodyShape(const Sphere& sphere) : mesh(sphere.mesh()), parts{SolidSphere{sphere.center, sphere.radius}} {}
  BodyShape(const Cylinder& cylinder)
      : mesh(cylinder.mesh()), parts{SolidRing{0, cylinder.radius, 0, cylinder.height}} {}

  /// Six slabs, or five. Slabs along x reach around the others' edges, so that no gap is left at the corners.
  BodyShape(const BoxInside& room) : mesh(room.mesh()) {
    const Vector3<double> wall = Vector3<double>::Constant(room.wall);
    Vector3<double> low = room.min - wall, high = room.max + wall;
    if (room.open) {
      const auto face = static_cast<int>(*room.open);
      (face % 2 == 0 ? low : high)[face / 2] = (face % 2 == 0 ? room.min : room.max)[face / 2];
    }
    for (int axis = 0; axis < 3; ++axis) {
      for (const bool upper : {false, true}) {
        if (room.open && static_cast<int>(*room.open) == 2 * axis + (upper ? 1 : 0)) {
          continue;
        }
        Vector3<double> slab_low = low, slab_high = high;
        for (int earlier = 0; earlier < axis; ++earlier) {
          slab_low[earlier] = room.min[earlier];
          slab_high[earlier] = room.max[earlier];
        }
        (upper ? slab_low : slab_high)[axis] = (upper ? room.max : room.min)[axis];
        parts.push_back(SolidBox{slab_low, slab_high});
      }
    }
  }

  /// A ring and one or two discs.
  BodyShape(const CylinderInside& vessel) : mesh(vessel.mesh()) {
    const double outer = vessel.radius + vessel.wall;
    parts.push_back(SolidRing{vessel.radius, outer, 0, vessel.height});
    if (vessel.open != Face::NegativeZ) {
      parts.push_back(SolidRing{0, outer, -vessel.wall, 0});
    }
    if (vessel.open != Face::PositiveZ) {
      parts.push_back(SolidRing{0, outer, vessel.height, vessel.height + vessel.wall});
    }
  }

  /// Turned shapes are meshes.
  BodyShape(const Revolved& turned) : mesh(turned.mesh()) {}
  BodyShape(const Cup& cup) : mesh(cup.mesh()) {}
  BodyShape(const Bowl& bowl) : mesh(bowl.mesh()) {}
};

}  // namespace decant::inline DECANT_TARGET
