// SPDX-License-Identifier: MIT
// VTK files: the XML says where each array lies, and there it lies.

#include <decant/io/vtk.hpp>

#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "catch.hpp"
#include "temporary_folder.hpp"

namespace {

std::string text_of(const std::filesystem::path& path) { return decant::detail::read_text_file(path, 1 << 20); }

// The values of the array of that name, found as a reader of the format would: by the offset in the XML.
template <class Value>
std::vector<Value> array_of(const std::string& file, const std::string& name, const std::string& type) {
  const std::size_t at = file.find("Name=\"" + name + "\"");
  REQUIRE(at != std::string::npos);
  const std::size_t begin = file.rfind('<', at), end = file.find("/>", at);
  const std::string tag = file.substr(begin, end - begin);
  CHECK(tag.find("type=\"" + type + "\"") != std::string::npos);
  const std::size_t offset = std::stoul(tag.substr(tag.find("offset=\"") + 8));
  const std::size_t data = file.find("<AppendedData encoding=\"raw\">\n_") + 31 + offset;
  std::uint64_t bytes = 0;
  REQUIRE(data + sizeof bytes <= file.size());
  std::memcpy(&bytes, file.data() + data, sizeof bytes);
  REQUIRE(data + sizeof bytes + bytes <= file.size());
  std::vector<Value> values(bytes / sizeof(Value));
  if (bytes > 0) {
    std::memcpy(values.data(), file.data() + data + sizeof bytes, bytes);
  }
  return values;
}

decant::TriangleMesh triangle() { return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}}; }

}  // namespace

TEMPLATE_TEST_CASE("vtk: particles with their arrays", "", float, double) {
  const decant_test::TemporaryFolder folder("vtk_particles" + std::to_string(sizeof(TestType)));
  decant::FluidState<TestType> fluid;
  fluid.resize(2);
  fluid.position.col(1) << TestType(1), TestType(2), TestType(3);
  fluid.velocity.col(0) << TestType(-1), TestType(0), TestType(5);
  fluid.pressure[1] = 7;
  fluid.density[0] = 1000;
  fluid.id[1] = 42;
  fluid.origin[0] = 3;
  decant::write_vtk_particles(folder.path() / "a.vtp", fluid);
  const std::string file = text_of(folder.path() / "a.vtp");
  const std::string real = sizeof(TestType) == 4 ? "Float32" : "Float64";
  CHECK(file.find("NumberOfPoints=\"2\" NumberOfVerts=\"2\" NumberOfPolys=\"0\"") != std::string::npos);
  CHECK(array_of<TestType>(file, "position", real) == std::vector<TestType>{0, 0, 0, 1, 2, 3});
  CHECK(array_of<TestType>(file, "velocity", real) == std::vector<TestType>{-1, 0, 5, 0, 0, 0});
  CHECK(array_of<TestType>(file, "pressure", real) == std::vector<TestType>{0, 7});
  CHECK(array_of<TestType>(file, "density", real) == std::vector<TestType>{1000, 0});
  CHECK(array_of<std::uint32_t>(file, "id", "UInt32") == std::vector<std::uint32_t>{0, 42});
  CHECK(array_of<std::uint32_t>(file, "origin", "UInt32") == std::vector<std::uint32_t>{3, 0});
  CHECK(array_of<std::int64_t>(file, "connectivity", "Int64") == std::vector<std::int64_t>{0, 1});
  CHECK(array_of<std::int64_t>(file, "offsets", "Int64") == std::vector<std::int64_t>{1, 2});
}

TEST_CASE("vtk: no particles at all is a file too") {
  const decant_test::TemporaryFolder folder("vtk_empty");
  decant::write_vtk_particles(folder.path() / "a.vtp", decant::FluidState<float>{});
  CHECK(array_of<float>(text_of(folder.path() / "a.vtp"), "position", "Float32").empty());
}

TEST_CASE("vtk: a mesh stands where its pose puts it") {
  const decant_test::TemporaryFolder folder("vtk_mesh");
  const decant::Pose pose{Eigen::Quaterniond(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ())), {0, 0, 2}};
  decant::write_vtk_mesh(folder.path() / "m.vtp", triangle(), pose);
  const std::string file = text_of(folder.path() / "m.vtp");
  const auto points = array_of<double>(file, "position", "Float64");
  REQUIRE(points.size() == 9);
  CHECK(points[3] == Approx(0).margin(1e-12));
  CHECK(points[4] == Approx(1));
  CHECK(points[5] == 2);
  CHECK(array_of<std::int64_t>(file, "connectivity", "Int64") == std::vector<std::int64_t>{0, 1, 2});
  CHECK(array_of<std::int64_t>(file, "offsets", "Int64") == std::vector<std::int64_t>{3});
}

TEST_CASE("vtk: a sequence lists every frame and writes still bodies once") {
  const decant_test::TemporaryFolder folder("vtk_sequence");
  decant::VtkSequence sequence(folder.path() / "run");
  decant::FluidState<float> fluid;
  fluid.resize(1);
  for (const double time : {0.0, 0.25}) {
    sequence.add_particles(time, fluid);
    sequence.add_body(time, 0, "a/../cup", triangle(), {}, false);
    sequence.add_body(time, 1, "lid", triangle(), {}, true);
  }
  sequence.finish();
  const std::string list = text_of(folder.path() / "run/all.pvd");
  for (const char* line : {"timestep=\"0\" part=\"0\" file=\"liquid_000000.vtp\"",
                           "timestep=\"0.25\" part=\"0\" file=\"liquid_000001.vtp\"",
                           "timestep=\"0.25\" part=\"1\" file=\"0_a____cup_000000.vtp\"",
                           "timestep=\"0.25\" part=\"2\" file=\"1_lid_000001.vtp\""}) {
    INFO(line);
    CHECK(list.find(line) != std::string::npos);
  }
  CHECK(std::filesystem::exists(folder.path() / "run/1_lid_000000.vtp"));
  CHECK_FALSE(std::filesystem::exists(folder.path() / "run/0_a____cup_000001.vtp"));
  const auto blocked = folder.write("file", "");
  CHECK(decant_test::message_of([&] { decant::VtkSequence{blocked / "run"}; }).find("cannot be made") !=
        std::string::npos);
}
