// SPDX-License-Identifier: MIT
#include <decant/io/mesh_file.hpp>

#include <cstring>
#include <string>
#include <vector>

#include <decant/boundary/shapes.hpp>

#include "catch.hpp"
#include "data.hpp"
#include "io/temporary_folder.hpp"

namespace {

using decant::MeshFormat;
using decant::parse_mesh;
using decant::TriangleMesh;
using decant_test::contains;

template <class Value>
std::string raw(Value value, bool big_endian) {
  std::string bytes(sizeof value, '\0');
  std::memcpy(bytes.data(), &value, sizeof value);
  const bool native_big = std::endian::native == std::endian::big;
  return big_endian == native_big ? bytes : std::string(bytes.rbegin(), bytes.rend());
}

// A tetrahedron with right angles at the origin and edges of 1, 2 and 3, in every way to write it.
const char* const tetrahedron_obj =
    "# a comment\nmtllib missing.mtl\no thing\nv 0 0 0\nv 1 0 0 # x\nv 0 +2.0 0 1.0\r\nv 0 0 3e0 0.1 0.2 0.3\nvn 0 0 "
    "1\n"
    "vt 0 0\nusemtl none\nf 1 3 2\nf 1/1 2/1 4/1\nf -4//1 -1//1 \\\n -2//1\nf 2/1/1 3/1/1 4/1/1\n";

const char* const tetrahedron_stl =
    "solid a vertex 1 2 3 facet\nfacet normal 0 0 -1\n outer loop\n vertex 0 0 0\n vertex 0 2 0\n vertex 1 0 0\n "
    "endloop\n"
    "endfacet\nfacet normal nan nan nan\n outer loop\n vertex 0 0 0\n vertex 1 0 0\n vertex 0 0 3\n endloop\nendfacet\n"
    "facet normal -1 0 0\n outer loop\n vertex 0 0 0\n vertex 0 0 3\n vertex 0 2 0\n endloop\nendfacet\n"
    "facet normal 1 1 1\n outer loop\n vertex 1 0 0\n vertex 0 2 0\n vertex 0 0 3\n endloop\nendfacet\nendsolid a\n";

std::string tetrahedron_ply(const std::string& format, const std::string& line_end = "\n") {
  const bool text = format == "ascii";
  const bool big = format == "binary_big_endian";
  std::string bytes;
  for (const std::string line :
       {"ply", "format", "comment made by hand", "element camera 1", "property uchar a", "element vertex 4",
        "property float x", "property double y", "property uchar red", "property float z", "element nothing 4000000000",
        "element face 4", "property list uchar float weights", "property list ushort int vertex_indices",
        "property short flag", "end_header"}) {
    bytes += line == "format" ? "format " + format + " 1.0" : line;
    bytes += line_end;
  }
  const auto add = [&](auto value) {
    if (text) {
      bytes += std::to_string(value) + " ";
    } else {
      bytes += raw(value, big);
    }
  };
  add(std::uint8_t{7});
  const double corners[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0, 0, 3}};
  for (const auto& corner : corners) {
    add(static_cast<float>(corner[0]));
    add(corner[1]);
    add(std::uint8_t{255});
    add(static_cast<float>(corner[2]));
  }
  const std::int32_t faces[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
  for (const auto& face : faces) {
    add(std::uint8_t{2});
    add(0.5F);
    add(-1.5F);
    add(std::uint16_t{3});
    for (const std::int32_t vertex : face) {
      add(vertex);
    }
    add(std::int16_t{-1});
  }
  return bytes;
}

void check_tetrahedron(const TriangleMesh& mesh) {
  REQUIRE(mesh.vertices.size() == 4);
  REQUIRE(mesh.triangles.size() == 4);
  REQUIRE(decant::signed_volume(mesh) == Approx(1));
  REQUIRE((decant::bounds(mesh).max() - decant::Vector3<double>(1, 2, 3)).norm() == 0);
}

std::string stl_bytes(const TriangleMesh& mesh, const std::string& header) {
  std::string bytes = header;
  bytes.resize(80);
  bytes += raw(static_cast<std::uint32_t>(mesh.triangles.size()), false);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    bytes.append(12, '\0');
    for (std::size_t k = 0; k < 3; ++k) {
      for (int axis = 0; axis < 3; ++axis) {
        bytes += raw(static_cast<float>(mesh.corner(t, k)[axis]), false);
      }
    }
    bytes.append(2, '\0');
  }
  return bytes;
}

}  // namespace

TEST_CASE("every format is read") {
  check_tetrahedron(parse_mesh(tetrahedron_obj, MeshFormat::Obj, "t"));
  check_tetrahedron(parse_mesh(tetrahedron_stl, MeshFormat::Stl, "t"));
  const TriangleMesh mesh = parse_mesh(tetrahedron_obj, MeshFormat::Obj, "t");
  check_tetrahedron(parse_mesh(stl_bytes(mesh, "made by a tool"), MeshFormat::Stl, "t"));
  check_tetrahedron(parse_mesh(stl_bytes(mesh, "solid though binary"), MeshFormat::Stl, "t"));
  check_tetrahedron(parse_mesh(stl_bytes(mesh, "more after the end") + "trailing", MeshFormat::Stl, "t"));
  for (const char* format : {"ascii", "binary_little_endian", "binary_big_endian"}) {
    check_tetrahedron(parse_mesh(tetrahedron_ply(format), MeshFormat::Ply, "t"));
    check_tetrahedron(parse_mesh(tetrahedron_ply(format, "\r\n"), MeshFormat::Ply, "t"));
  }
  const TriangleMesh pentagon =
      parse_mesh("v 0 0 0\nv 1 0 0\nv 2 1 0\nv 1 2 0\nv 0 1 0\nf 1 2 3 4 5\n", MeshFormat::Obj, "t");
  REQUIRE(pentagon.triangles.size() == 3);
  REQUIRE(decant::surface_area(pentagon) == Approx(2.5));
}

TEST_CASE("what is written reads back") {
  const decant_test::TemporaryFolder folder("mesh_file");
  const TriangleMesh mesh = decant::Cup{}.mesh();
  decant::write_mesh(folder.path() / "cup.ply", mesh);
  const TriangleMesh ply = decant::read_mesh(folder.path() / "cup.ply");
  const TriangleMesh merged = decant::welded(mesh);
  REQUIRE(ply.vertices == merged.vertices);
  REQUIRE(ply.triangles == merged.triangles);
  decant::write_mesh(folder.path() / "cup.STL", mesh);
  const TriangleMesh stl = decant::read_mesh(folder.path() / "cup.STL");
  REQUIRE(stl.triangles.size() == mesh.triangles.size());
  REQUIRE(stl.vertices.size() == merged.vertices.size());
  REQUIRE(decant::signed_volume(stl) == Approx(decant::signed_volume(mesh)).epsilon(1e-5));
  REQUIRE_THROWS_WITH(decant::write_mesh(folder.path() / "cup.obj", mesh), contains("must be ending in .ply or .stl"));
  REQUIRE_THROWS_AS(decant::write_mesh(folder.path() / "cup.ply", TriangleMesh{}), std::invalid_argument);
  REQUIRE_THROWS_WITH(decant::write_mesh(folder.path() / "no" / "cup.ply", mesh), contains("cannot be written"));
  REQUIRE_THROWS_WITH(decant::read_mesh(folder.path() / "cup.3ds"), contains("must be ending in .ply, .obj or .stl"));
  REQUIRE_THROWS_WITH(decant::read_mesh(folder.path() / "none.ply"), contains("none.ply"));
}

TEST_CASE("broken mesh files are refused in one line that names the file") {
  const auto refused = [](const std::string& bytes, MeshFormat format, const std::string& part) {
    const std::string message = decant_test::message_of([&] { parse_mesh(bytes, format, "cup.x"); });
    INFO(message);
    REQUIRE(message.find("cup.x: ") == 0);
    REQUIRE(message.find(part) != std::string::npos);
    REQUIRE(message.find('\n') == std::string::npos);
    REQUIRE_THROWS_AS(parse_mesh(bytes, format, "cup.x"), std::runtime_error);
  };
  const std::string three = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  refused("", MeshFormat::Obj, "number of faces must be >= 1");
  refused(three, MeshFormat::Obj, "number of faces must be >= 1");
  refused(three + "f 1 2\n", MeshFormat::Obj, "number of corners of face 0 must be >= 3, got 2");
  refused(three + "f 1 2 4\n", MeshFormat::Obj, "line 4: vertex of a face must be 1..3");
  refused(three + "f 1 2 0\n", MeshFormat::Obj, "line 4: vertex of a face");
  refused(three + "f 1 2 -4\n", MeshFormat::Obj, "line 4: vertex of a face");
  refused(three + "f 1 2 99999999999999999999\n", MeshFormat::Obj, "line 4: vertex of a face");
  refused(three + "f 1 2 x\n", MeshFormat::Obj, "got \"x\"");
  refused("v 0 0\n", MeshFormat::Obj, "line 1: coordinate z must be a finite number, got the end of the file");
  refused("v 0 nan 0\n", MeshFormat::Obj, "line 1: coordinate y must be a finite number, got \"nan\"");
  refused("v 0 1e10 0\n", MeshFormat::Obj, "coordinate of vertex 0 must be finite and within 1e9");

  refused("", MeshFormat::Stl, "beginning must be the word solid");
  refused("solid\n", MeshFormat::Stl, "number of faces must be >= 1");
  refused("solid a\nfacet normal 0 0", MeshFormat::Stl, "component z of a normal");
  refused("solid a\nvertex 0 0", MeshFormat::Stl, "coordinate z of a vertex");
  refused("solid a\nfacet color 1", MeshFormat::Stl, "word in a text STL");
  refused("solid a\nvertex 0 0 0 vertex 1 1 1 endloop", MeshFormat::Stl, "number of corners of face 0");
  std::string stl = stl_bytes(parse_mesh(tetrahedron_obj, MeshFormat::Obj, "t"), "x");
  refused(stl.substr(0, stl.size() - 1), MeshFormat::Stl,
          "number of triangles must be what the file has bytes for (3), got 4");
  stl.replace(80, 4, 4, '\xff');
  refused(stl, MeshFormat::Stl, "got 4294967295");
  stl.replace(96, 4, raw(std::numeric_limits<float>::quiet_NaN(), false));
  stl.replace(80, 4, raw(std::uint32_t{4}, false));
  refused(stl, MeshFormat::Stl, "coordinate of vertex 0");

  const std::string head = "ply\nformat ascii 1.0\n";
  const std::string vertices = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
  const std::string face = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  const std::string places = "0 0 0 1 0 0 0 1 0 ";
  REQUIRE_NOTHROW(parse_mesh(head + vertices + face + places + "3 0 1 2", MeshFormat::Ply, "t"));
  refused("", MeshFormat::Ply, "PLY header");
  refused("plx\n", MeshFormat::Ply, "first line");
  refused("ply\nformat binary 1.0\n", MeshFormat::Ply, "PLY format");
  refused("ply\nend_header\n", MeshFormat::Ply, "with a format line");
  refused(head + "hello\n", MeshFormat::Ply, "PLY header line");
  refused(head + "element vertex -1\n", MeshFormat::Ply, "count must be a whole number");
  refused(head + "property float x\n", MeshFormat::Ply, "below an element");
  refused(head + "element face 1\nproperty list float int v\n", MeshFormat::Ply, "counted by an integer type");
  refused(head + "element face 1\nproperty quad v\n", MeshFormat::Ply, "of a type such as");
  refused(head + "element vertex 1\nproperty float x\nend_header\n0 0 0", MeshFormat::Ply,
          "with properties x, y and z");
  refused(head + "element face 1\nproperty float x\nend_header\n0 0 0", MeshFormat::Ply, "with a list vertex_indices");
  refused(head + "element vertex 4000000000\nproperty float x\nend_header\n0", MeshFormat::Ply,
          "what the file has bytes for");
  refused(head + vertices + face + places + "3 0 1", MeshFormat::Ply, "got the end of the file");
  refused(head + vertices + face + places + "3 0 1 3", MeshFormat::Ply, "must be below 3, got 3");
  refused(head + vertices + face + places + "3 0 1 -1", MeshFormat::Ply, "vertex index must be a whole number");
  refused(head + vertices + face + places + "3 0 1 0.5", MeshFormat::Ply, "vertex index must be a whole number");
  refused(head + vertices + face + places + "-3 0 1 2", MeshFormat::Ply, "length of a list");
  refused(head + vertices + face + places + "4294967295 0 1 2", MeshFormat::Ply, "got the end of the file");
}

TEST_CASE("no damage to a mesh file does more than being refused") {
  const std::vector<std::pair<std::string, MeshFormat>> files{
      {tetrahedron_obj, MeshFormat::Obj},
      {tetrahedron_stl, MeshFormat::Stl},
      {stl_bytes(parse_mesh(tetrahedron_obj, MeshFormat::Obj, "t"), "x"), MeshFormat::Stl},
      {tetrahedron_ply("ascii"), MeshFormat::Ply},
      {tetrahedron_ply("binary_little_endian"), MeshFormat::Ply},
      {tetrahedron_ply("binary_big_endian"), MeshFormat::Ply}};
  for (const auto& [bytes, format] : files) {
    int read = 0;
    const auto survive = [&, kind = format](const std::string& damaged) {
      try {
        decant::validate(parse_mesh(damaged, kind, "t"));
        ++read;
      } catch (const std::runtime_error& error) {
        REQUIRE(std::string(error.what()).find('\n') == std::string::npos);
      }
    };
    for (std::size_t k = 0; k < bytes.size(); ++k) {
      survive(bytes.substr(0, k));
      for (const char byte : {'\0', '\xff', '9', ' ', '-'}) {
        std::string damaged = bytes;
        damaged[k] = byte;
        survive(damaged);
      }
    }
    REQUIRE(read > 0);
  }
}

TEST_CASE("scans are read with their size and volume") {
  struct Case {
    const char* file;
    double size_mm[3];
    double material_ml;
    std::size_t triangles;
  };
  const Case cases[] = {{"meshes_contactdb/cup.stl", {84.7, 84.7, 100.0}, 98.9, 4000},
                        {"meshes_contactdb/bowl.stl", {148.9, 149.0, 76.6}, 278.5, 5000},
                        {"meshes_ycb/024_bowl.obj", {161.5, 161.2, 55.0}, 33.4, 16384},
                        {"meshes_ycb/025_mug.obj", {117.0, 93.1, 81.3}, 138.1, 16384}};
  for (const Case& scan : cases) {
    if (const auto path = decant_test::measurements(scan.file)) {
      const TriangleMesh mesh = decant::read_mesh(*path);
      INFO(scan.file);
      REQUIRE(mesh.triangles.size() == scan.triangles);
      REQUIRE(1e6 * decant::signed_volume(mesh) == Approx(scan.material_ml).epsilon(2e-3));
      const decant::Vector3<double> size = decant::bounds(mesh).sizes();
      for (int axis = 0; axis < 3; ++axis) {
        REQUIRE(1e3 * size[axis] == Approx(scan.size_mm[axis]).margin(0.1));
      }
    }
  }
}
