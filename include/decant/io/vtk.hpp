// SPDX-License-Identifier: MIT
#pragma once

/// Writes particles and meshes as VTK files (XML PolyData, .vtp, binary) and time collections (.pvd), for ParaView.

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <numeric>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include <decant/boundary/triangle_mesh.hpp>
#include <decant/core/fluid_state.hpp>
#include <decant/core/pose.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/io/detail/text.hpp>

namespace decant::inline DECANT_TARGET {

namespace detail {

/// One .vtp file: XML that describes arrays, then the arrays as they lie in memory ("raw" appended data, each preceded
/// by its size in bytes as UInt64).
class VtpFile {
 public:
  VtpFile(std::size_t points, std::size_t vertices, std::size_t polygons) {
    header_ = "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"";
    header_ += std::endian::native == std::endian::little ? "LittleEndian" : "BigEndian";
    header_ += "\" header_type=\"UInt64\">\n<PolyData>\n<Piece NumberOfPoints=\"" + std::to_string(points) +
               "\" NumberOfVerts=\"" + std::to_string(vertices) + "\" NumberOfPolys=\"" + std::to_string(polygons) +
               "\" NumberOfLines=\"0\" NumberOfStrips=\"0\">\n";
  }

  void open(const char* element) { header_.append("<").append(element).append(">\n"); }
  void close(const char* element) { header_.append("</").append(element).append(">\n"); }

  template <class Value>
  void array(const char* name, int components, const Value* values, std::size_t count) {
    header_.append("<DataArray type=\"").append(type_name<Value>()).append("\" Name=\"").append(name);
    header_ += "\" NumberOfComponents=\"" + std::to_string(components) + "\" format=\"appended\" offset=\"" +
               std::to_string(data_.size()) + "\"/>\n";
    const std::uint64_t bytes = count * sizeof(Value);
    append(&bytes, sizeof bytes);
    append(values, static_cast<std::size_t>(bytes));
  }

  void write(const std::filesystem::path& path) {
    std::string text = header_ + "</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_";
    text += data_;
    text += "\n</AppendedData>\n</VTKFile>\n";
    write_text_file(path, text);
  }

 private:
  template <class Value>
  static constexpr const char* type_name() {
    if constexpr (std::is_same_v<Value, float>) {
      return "Float32";
    } else if constexpr (std::is_same_v<Value, double>) {
      return "Float64";
    } else if constexpr (std::is_same_v<Value, std::uint32_t>) {
      return "UInt32";
    } else {
      static_assert(std::is_same_v<Value, std::int64_t>, "VtpFile: no VTK name for this number type");
      return "Int64";
    }
  }

  void append(const void* bytes, std::size_t count) {
    if (count > 0) {
      const std::size_t end = data_.size();
      data_.resize(end + count);
      std::memcpy(data_.data() + end, bytes, count);
    }
  }

  std::string header_;
  std::string data_;
};

}  // namespace detail

/// Particles as points with the arrays velocity [m/s], density [kg/m^3], pressure [Pa], id and origin. Throws
/// std::runtime_error where the file cannot be written.
template <class Scalar>
void write_vtk_particles(const std::filesystem::path& path, const FluidState<Scalar>& fluid) {
  const auto count = static_cast<std::size_t>(fluid.size());
  std::vector<std::int64_t> numbers(count + 1);
  std::iota(numbers.begin(), numbers.end(), std::int64_t{0});
  detail::VtpFile file(count, count, 0);
  file.open("PointData");
  file.array("velocity", 3, fluid.velocity.data(), 3 * count);
  file.array("density", 1, fluid.density.data(), count);
  file.array("pressure", 1, fluid.pressure.data(), count);
  file.array("id", 1, fluid.id.data(), count);
  file.array("origin", 1, fluid.origin.data(), count);
  file.close("PointData");
  file.open("Points");
  file.array("position", 3, fluid.position.data(), 3 * count);
  file.close("Points");
  file.open("Verts");  // one cell per point, so that every view of ParaView shows them
  file.array("connectivity", 1, numbers.data(), count);
  file.array("offsets", 1, numbers.data() + 1, count);
  file.close("Verts");
  file.write(path);
}

/// A body's surface where `world_from_body` puts it. Throws std::runtime_error where the file cannot be written.
inline void write_vtk_mesh(const std::filesystem::path& path, const TriangleMesh& mesh, const Pose& world_from_body) {
  std::vector<double> points;
  points.reserve(3 * mesh.vertices.size());
  for (const Vector3<double>& vertex : mesh.vertices) {
    const Vector3<double> x = world_from_body * vertex;
    points.insert(points.end(), x.data(), x.data() + 3);
  }
  std::vector<std::int64_t> corners, offsets;
  for (const auto& triangle : mesh.triangles) {
    corners.insert(corners.end(), triangle.begin(), triangle.end());
    offsets.push_back(static_cast<std::int64_t>(corners.size()));
  }
  detail::VtpFile file(mesh.vertices.size(), 0, mesh.triangles.size());
  file.open("Points");
  file.array("position", 3, points.data(), points.size());
  file.close("Points");
  file.open("Polys");
  file.array("connectivity", 1, corners.data(), corners.size());
  file.array("offsets", 1, offsets.data(), offsets.size());
  file.close("Polys");
  file.write(path);
}

/// Writes the frames of a run into one folder: liquid_000000.vtp, <body>_000000.vtp and, at the end, all.pvd, which
/// ParaView opens with its time line. Still bodies are written once. Body names become file names with anything but
/// letters, digits, '-' and '_' replaced.
class VtkSequence {
 public:
  /// Makes the folder if need be. Throws std::runtime_error where it cannot.
  explicit VtkSequence(std::filesystem::path folder) : folder_(std::move(folder)) {
    std::error_code error;
    std::filesystem::create_directories(folder_, error);
    if (error) {
      throw std::runtime_error(folder_.string() + ": cannot be made: " + error.message());
    }
  }

  template <class Scalar>
  void add_particles(double time, const FluidState<Scalar>& fluid) {
    const std::string name = "liquid_" + six_digits(times_liquid_++) + ".vtp";
    write_vtk_particles(folder_ / name, fluid);
    entries_.push_back({time, 0, name});
  }

  /// `number` tells bodies apart, from 0; `moving` bodies are written at each call, others at their first.
  void add_body(double time, std::size_t number, const std::string& body, const TriangleMesh& mesh, const Pose& pose,
                bool moving) {
    if (number >= frames_.size()) {
      frames_.resize(number + 1, 0);
      names_.resize(number + 1);
    }
    if (moving || frames_[number] == 0) {
      names_[number] = std::to_string(number) + "_" + file_name(body) + "_" + six_digits(frames_[number]++) + ".vtp";
      write_vtk_mesh(folder_ / names_[number], mesh, pose);
    }
    entries_.push_back({time, number + 1, names_[number]});
  }

  /// Writes all.pvd; call it last, or now and then, so that a run that is stopped can be looked at.
  void finish() const {
    std::string text = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n";
    for (const Entry& entry : entries_) {
      text += "<DataSet timestep=\"" + detail::number_text(entry.time) + "\" part=\"" + std::to_string(entry.part) +
              "\" file=\"" + entry.file + "\"/>\n";
    }
    detail::write_text_file(folder_ / "all.pvd", text + "</Collection>\n</VTKFile>\n");
  }

 private:
  struct Entry {
    double time;
    std::size_t part;
    std::string file;
  };

  static std::string six_digits(std::size_t number) {
    const std::string digits = std::to_string(number);
    return digits.size() < 6 ? std::string(6 - digits.size(), '0') + digits : digits;
  }

  static std::string file_name(std::string name) {
    for (char& c : name) {
      const bool plain = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-';
      c = plain ? c : '_';
    }
    return name.substr(0, 60);
  }

  std::filesystem::path folder_;
  std::vector<Entry> entries_;
  std::vector<std::size_t> frames_;
  std::vector<std::string> names_;
  std::size_t times_liquid_ = 0;
};

}  // namespace decant::inline DECANT_TARGET
