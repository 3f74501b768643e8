// SPDX-License-Identifier: MIT
#pragma once

/// Reads and writes the triangle meshes that scans and CAD come in. The readers are small ones of our own, since files
/// may come from anywhere and the general import libraries that distributions ship (Debian 12: assimp 5.2) have known
/// overflows on crafted files. Every count in a file is held against the bytes that the file has before memory is taken
/// for it, every index against the vertices.

#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include <decant/boundary/triangle_mesh.hpp>
#include <decant/core/target.hpp>
#include <decant/core/types.hpp>
#include <decant/io/detail/text.hpp>

namespace decant::inline DECANT_TARGET {

/// Formats of mesh files.
enum class MeshFormat {
  Ply,  ///< Stanford PLY: text, binary of either byte order
  Obj,  ///< Wavefront: v and f lines, the rest is passed over
  Stl,  ///< text and binary
};

namespace detail {

// Where a reader is in the file's bytes, and how it complains.
class MeshBytes {
 public:
  MeshBytes(std::string_view bytes, std::string_view file) : bytes_(bytes), file_(file) {}

  [[noreturn]] void refuse(std::string_view what, std::string_view expected, std::string_view got) const {
    std::string where(file_);
    refuse_file(where.append(": ").append(what), expected, got);
  }

  std::size_t left() const noexcept { return bytes_.size() - at_; }
  std::string_view rest() const noexcept { return bytes_.substr(at_); }
  void skip(std::size_t count) noexcept { at_ += count; }

  // The next word, empty at the end of the file.
  std::string_view word() noexcept {
    while (at_ < bytes_.size() && blank(bytes_[at_])) {
      ++at_;
    }
    const std::size_t begin = at_;
    while (at_ < bytes_.size() && !blank(bytes_[at_])) {
      ++at_;
    }
    return bytes_.substr(begin, at_ - begin);
  }

  double number(std::string_view what) {
    const std::string_view text = word();
    const auto value = parse_number(text);
    if (!value) {
      refuse(what, "a finite number", text.empty() ? "the end of the file" : visible_text(text));
    }
    return *value;
  }

  // A fixed-size value of a binary file. The caller has checked that the bytes are there.
  template <class Value>
  Value binary(bool little_endian) noexcept {
    std::array<unsigned char, sizeof(Value)> raw;
    std::memcpy(raw.data(), bytes_.data() + at_, raw.size());
    at_ += raw.size();
    if (little_endian != (std::endian::native == std::endian::little)) {
      for (std::size_t k = 0; k < raw.size() / 2; ++k) {
        std::swap(raw[k], raw[raw.size() - 1 - k]);
      }
    }
    return std::bit_cast<Value>(raw);
  }

  static bool blank(char c) noexcept { return c == ' ' || (c >= '\t' && c <= '\r'); }

 private:
  std::string_view bytes_;
  std::string_view file_;
  std::size_t at_ = 0;
};

// Takes vertices and polygons with the checks that all formats share.
class MeshBuilder {
 public:
  explicit MeshBuilder(const MeshBytes& bytes) : bytes_(&bytes) {}

  std::size_t vertex_count() const noexcept { return mesh_.vertices.size(); }

  std::uint32_t add_vertex(double x, double y, double z) {
    for (const double value : {x, y, z}) {
      if (!(std::abs(value) <= 1e9)) {
        bytes_->refuse("coordinate of vertex " + std::to_string(mesh_.vertices.size()), "finite and within 1e9",
                       number_text(value));
      }
    }
    mesh_.vertices.emplace_back(x, y, z);
    return static_cast<std::uint32_t>(mesh_.vertices.size() - 1);
  }

  // Indices from 0. A PLY file may list faces before vertices, hence checked at the end.
  void add_corner(std::uint32_t vertex) { polygon_.push_back(vertex); }

  // Cuts the polygon into a fan from its first corner, which suits convex ones.
  void end_polygon() {
    if (polygon_.size() < 3) {
      bytes_->refuse("number of corners of face " + std::to_string(face_count_), ">= 3",
                     std::to_string(polygon_.size()));
    }
    for (std::size_t k = 2; k < polygon_.size(); ++k) {
      mesh_.triangles.push_back({polygon_[0], polygon_[k - 1], polygon_[k]});
    }
    polygon_.clear();
    ++face_count_;
  }

  TriangleMesh finish() {
    if (mesh_.triangles.empty()) {
      bytes_->refuse("number of faces", ">= 1", "0");
    }
    for (const TriangleMesh::Triangle& triangle : mesh_.triangles) {
      for (const std::uint32_t vertex : triangle) {
        if (!(vertex < mesh_.vertices.size())) {
          bytes_->refuse("vertex index (from 0) of a face", "below " + std::to_string(mesh_.vertices.size()),
                         std::to_string(vertex));
        }
      }
    }
    return welded(mesh_);
  }

 private:
  const MeshBytes* bytes_;
  TriangleMesh mesh_;
  std::vector<std::uint32_t> polygon_;
  std::size_t face_count_ = 0;
};

inline TriangleMesh parse_stl(std::string_view bytes, std::string_view file) {
  MeshBytes in(bytes, file);
  MeshBuilder mesh(in);
  // Binary files may begin with "solid" as well; only their size is a sure sign.
  constexpr std::size_t header = 84;
  constexpr std::size_t record = 50;
  std::uint64_t count = 0;
  if (bytes.size() >= header) {
    in.skip(80);
    count = in.binary<std::uint32_t>(true);
  }
  const bool text = trimmed(bytes.substr(0, 4096)).substr(0, 5) == "solid";
  if (bytes.size() >= header && (bytes.size() == header + record * count || !text)) {
    if (count > (bytes.size() - header) / record) {
      in.refuse("number of triangles",
                "what the file has bytes for (" + std::to_string((bytes.size() - header) / record) + ")",
                std::to_string(count));
    }
    for (std::uint64_t t = 0; t < count; ++t) {
      in.skip(12);  // the normal, which follows from the corners
      for (int k = 0; k < 3; ++k) {
        const double x = static_cast<double>(in.binary<float>(true));
        const double y = static_cast<double>(in.binary<float>(true));
        const double z = static_cast<double>(in.binary<float>(true));
        mesh.add_corner(mesh.add_vertex(x, y, z));
      }
      in.skip(2);
      mesh.end_polygon();
    }
    return mesh.finish();
  }
  if (!text) {
    in.refuse("beginning", "the word solid, or 84 bytes of a binary STL header",
              std::to_string(bytes.size()) + " bytes");
  }
  MeshBytes words(bytes, file);
  // Names of solids are free text: facets begin after the first word that says so.
  for (std::string_view word = words.word(); !word.empty(); word = words.word()) {
    if (word == "vertex") {
      const double x = words.number("coordinate x of a vertex");
      const double y = words.number("coordinate y of a vertex");
      const double z = words.number("coordinate z of a vertex");
      mesh.add_corner(mesh.add_vertex(x, y, z));
    } else if (word == "endloop") {
      mesh.end_polygon();
    } else if (word == "solid" || word == "endsolid") {
      const std::size_t line_end = words.rest().find('\n');
      words.skip(line_end == std::string_view::npos ? words.left() : line_end);
    } else if (word == "normal") {
      for (const char* part : {"x", "y", "z"}) {
        const std::string_view number = words.word();  // some writers put nan for triangles without area
        if (number.empty()) {
          words.refuse(std::string("component ") + part + " of a normal", "a number", "the end of the file");
        }
      }
    } else if (word != "facet" && word != "outer" && word != "loop" && word != "endfacet") {
      words.refuse("word in a text STL", "one of facet, normal, outer, loop, vertex, endloop, endfacet, endsolid",
                   visible_text(word));
    }
  }
  return mesh.finish();
}

inline TriangleMesh parse_obj(std::string_view bytes, std::string_view file) {
  MeshBytes in(bytes, file);
  MeshBuilder mesh(in);
  std::string_view rest = bytes;
  std::string joined_line;
  std::size_t line_number = 0;
  while (auto line = next_line(rest)) {
    ++line_number;
    if (!line->empty() && line->back() == '\\') {
      joined_line.clear();
      while (line && !line->empty() && line->back() == '\\') {
        joined_line.append(line->substr(0, line->size() - 1)).push_back(' ');
        line = next_line(rest);
        ++line_number;
      }
      joined_line.append(line.value_or(std::string_view()));
      line = joined_line;
    }
    const std::string where = "line " + std::to_string(line_number);
    const std::string_view content = line->substr(0, line->find('#'));
    MeshBytes words(content, file);
    const std::string_view key = words.word();
    if (key == "v") {
      const double x = words.number(where + ": coordinate x");
      const double y = words.number(where + ": coordinate y");
      const double z = words.number(where + ": coordinate z");
      mesh.add_vertex(x, y, z);  // a weight or a colour may follow
    } else if (key == "f") {
      for (std::string_view corner = words.word(); !corner.empty(); corner = words.word()) {
        const std::string_view text = corner.substr(0, corner.find('/'));
        std::int64_t index = 0;
        const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), index);
        const auto count = static_cast<std::int64_t>(mesh.vertex_count());
        // from 1, or back from the latest vertex; only vertices that came before may be used
        const bool known = error == std::errc() && end == text.data() + text.size() &&
                           ((index >= 1 && index <= count) || (index < 0 && index >= -count));
        if (!known) {
          in.refuse(where + ": vertex of a face", "1.." + std::to_string(count) + " or as negative, of those above it",
                    visible_text(corner));
        }
        mesh.add_corner(static_cast<std::uint32_t>(index > 0 ? index - 1 : count + index));
      }
      mesh.end_polygon();
    }
  }
  return mesh.finish();
}

// Value types of PLY.
enum class PlyType { Int8, UInt8, Int16, UInt16, Int32, UInt32, Float32, Float64 };

inline std::optional<PlyType> ply_type(std::string_view name) {
  constexpr std::array<std::pair<std::string_view, PlyType>, 16> names{{{"char", PlyType::Int8},
                                                                        {"int8", PlyType::Int8},
                                                                        {"uchar", PlyType::UInt8},
                                                                        {"uint8", PlyType::UInt8},
                                                                        {"short", PlyType::Int16},
                                                                        {"int16", PlyType::Int16},
                                                                        {"ushort", PlyType::UInt16},
                                                                        {"uint16", PlyType::UInt16},
                                                                        {"int", PlyType::Int32},
                                                                        {"int32", PlyType::Int32},
                                                                        {"uint", PlyType::UInt32},
                                                                        {"uint32", PlyType::UInt32},
                                                                        {"float", PlyType::Float32},
                                                                        {"float32", PlyType::Float32},
                                                                        {"double", PlyType::Float64},
                                                                        {"float64", PlyType::Float64}}};
  for (const auto& [known, type] : names) {
    if (known == name) {
      return type;
    }
  }
  return std::nullopt;
}

inline std::size_t ply_size(PlyType type) noexcept {
  constexpr std::array<std::size_t, 8> sizes{1, 1, 2, 2, 4, 4, 4, 8};
  return sizes[static_cast<std::size_t>(type)];
}

struct PlyProperty {
  std::string name;
  PlyType type = PlyType::Float32;      // of the value, or of a list's entries
  std::optional<PlyType> list_count{};  // of a list
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties{};
};

class PlyReader {
 public:
  PlyReader(std::string_view bytes, std::string_view file) : in_(bytes, file), mesh_(in_) {}

  TriangleMesh read() {
    read_header();
    for (const PlyElement& element : elements_) {
      read_element(element);
    }
    return mesh_.finish();
  }

 private:
  enum class Coding { Text, Little, Big };

  std::string_view header_line() {
    std::string_view rest = in_.rest();
    const auto line = next_line(rest);
    if (!line || (in_.left() == rest.size())) {
      in_.refuse("PLY header", "closed by end_header", "the end of the file");
    }
    in_.skip(in_.left() - rest.size());
    return *line;
  }

  void read_header() {
    if (header_line() != "ply") {
      in_.refuse("first line", "ply", "another");
    }
    bool have_format = false;
    for (;;) {
      const std::string_view line = header_line();
      MeshBytes words(line, "");
      const std::string_view key = words.word();
      if (key == "end_header") {
        break;
      }
      if (key == "format") {
        const std::string_view name = words.word();
        if (name == "ascii") {
          coding_ = Coding::Text;
        } else if (name == "binary_little_endian") {
          coding_ = Coding::Little;
        } else if (name == "binary_big_endian") {
          coding_ = Coding::Big;
        } else {
          in_.refuse("PLY format", "ascii, binary_little_endian or binary_big_endian", visible_text(name));
        }
        have_format = true;
      } else if (key == "element") {
        PlyElement element;
        element.name = words.word();
        const std::string_view count = words.word();
        const auto [end, error] = std::from_chars(count.data(), count.data() + count.size(), element.count);
        if (error != std::errc() || end != count.data() + count.size()) {
          in_.refuse("PLY element " + visible_text(element.name) + ": count", "a whole number", visible_text(count));
        }
        elements_.push_back(std::move(element));
      } else if (key == "property") {
        if (elements_.empty()) {
          in_.refuse("PLY property", "below an element", visible_text(line));
        }
        elements_.back().properties.push_back(read_property(words, line));
      } else if (key != "comment" && key != "obj_info" && !key.empty()) {
        in_.refuse("PLY header line", "format, element, property, comment, obj_info or end_header", visible_text(line));
      }
    }
    if (!have_format) {
      in_.refuse("PLY header", "with a format line", "none");
    }
  }

  PlyProperty read_property(MeshBytes& words, std::string_view line) const {
    PlyProperty property;
    std::string_view type = words.word();
    if (type == "list") {
      property.list_count = ply_type(words.word());
      if (!property.list_count || *property.list_count == PlyType::Float32 ||
          *property.list_count == PlyType::Float64) {
        in_.refuse("PLY property list", "counted by an integer type", visible_text(line));
      }
      type = words.word();
    }
    const auto value_type = ply_type(type);
    if (!value_type) {
      in_.refuse("PLY property", "of a type such as float or uchar", visible_text(line));
    }
    property.type = *value_type;
    property.name = words.word();
    return property;
  }

  // One value, as a double, which holds every type of PLY exactly.
  double value(PlyType type, std::string_view what) {
    if (coding_ == Coding::Text) {
      return in_.number(what);
    }
    if (in_.left() < ply_size(type)) {
      in_.refuse(what, "there", "the end of the file");
    }
    const bool little = coding_ == Coding::Little;
    switch (type) {
      case PlyType::Int8:
        return in_.binary<std::int8_t>(little);
      case PlyType::UInt8:
        return in_.binary<std::uint8_t>(little);
      case PlyType::Int16:
        return in_.binary<std::int16_t>(little);
      case PlyType::UInt16:
        return in_.binary<std::uint16_t>(little);
      case PlyType::Int32:
        return in_.binary<std::int32_t>(little);
      case PlyType::UInt32:
        return in_.binary<std::uint32_t>(little);
      case PlyType::Float32:
        return static_cast<double>(in_.binary<float>(little));
      case PlyType::Float64:
        break;
    }
    return in_.binary<double>(little);
  }

  std::uint32_t whole(double number, std::string_view what) const {
    if (!(number >= 0 && number <= std::numeric_limits<std::uint32_t>::max() && number == std::floor(number))) {
      in_.refuse(what, "a whole number from 0 to 2^32 - 1", number_text(number));
    }
    return static_cast<std::uint32_t>(number);
  }

  void read_element(const PlyElement& element) {
    if (element.properties.empty()) {
      return;  // takes no bytes, so that its count may be anything
    }
    std::size_t smallest = 0;  // bytes of one entry
    std::array<std::size_t, 3> place_of_axis{};
    std::array<bool, 3> have_axis{};
    std::size_t corners = element.properties.size();
    for (std::size_t k = 0; k < element.properties.size(); ++k) {
      const PlyProperty& property = element.properties[k];
      // a word of text takes a digit and a blank; the last one of the file may lack the blank
      smallest += coding_ == Coding::Text ? 2 : ply_size(property.list_count.value_or(property.type));
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (!property.list_count && property.name == std::array{"x", "y", "z"}[axis]) {
          place_of_axis[axis] = k;
          have_axis[axis] = true;
        }
      }
      if (property.list_count && (property.name == "vertex_indices" || property.name == "vertex_index")) {
        corners = k;
      }
    }
    if (element.count > (in_.left() + 1) / smallest) {
      in_.refuse("PLY element " + visible_text(element.name) + ": count",
                 "what the file has bytes for (" + std::to_string((in_.left() + 1) / smallest) + ")",
                 std::to_string(element.count));
    }
    const bool is_vertex = element.name == "vertex";
    const bool is_face = element.name == "face";
    if (is_vertex && !(have_axis[0] && have_axis[1] && have_axis[2])) {
      in_.refuse("PLY element vertex", "with properties x, y and z", "others");
    }
    if (is_face && corners == element.properties.size()) {
      in_.refuse("PLY element face", "with a list vertex_indices", "others");
    }
    const std::string what = "PLY element " + visible_text(element.name);
    std::array<double, 3> position{};
    for (std::uint64_t entry = 0; entry < element.count; ++entry) {
      for (std::size_t k = 0; k < element.properties.size(); ++k) {
        const PlyProperty& property = element.properties[k];
        if (property.list_count) {
          const std::uint32_t count = whole(value(*property.list_count, what), what + ": length of a list");
          for (std::uint32_t n = 0; n < count; ++n) {
            const double number = value(property.type, what);
            if (is_face && k == corners) {
              mesh_.add_corner(whole(number, what + ": vertex index"));
            }
          }
          if (is_face && k == corners) {
            mesh_.end_polygon();
          }
        } else {
          const double number = value(property.type, what);
          for (std::size_t axis = 0; axis < 3; ++axis) {
            if (place_of_axis[axis] == k) {
              position[axis] = number;
            }
          }
        }
      }
      if (is_vertex) {
        mesh_.add_vertex(position[0], position[1], position[2]);
      }
    }
  }

  MeshBytes in_;
  MeshBuilder mesh_;
  Coding coding_ = Coding::Text;
  std::vector<PlyElement> elements_;
};

inline std::optional<MeshFormat> mesh_format(const std::filesystem::path& path) {
  std::string ending = path.extension().string();
  for (char& c : ending) {
    c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  }
  if (ending == ".ply") {
    return MeshFormat::Ply;
  }
  if (ending == ".obj") {
    return MeshFormat::Obj;
  }
  if (ending == ".stl") {
    return MeshFormat::Stl;
  }
  return std::nullopt;
}

// Appends a value's bytes, lowest first.
template <class Value>
void append_little_endian(std::string& bytes, Value value) {
  auto raw = std::bit_cast<std::array<char, sizeof(Value)>>(value);
  if constexpr (std::endian::native == std::endian::big) {
    for (std::size_t k = 0; k < raw.size() / 2; ++k) {
      std::swap(raw[k], raw[raw.size() - 1 - k]);
    }
  }
  bytes.append(raw.data(), raw.size());
}

}  // namespace detail

/// The mesh in the bytes of a file, in the file's units (formats do not tell them). Vertices at equal coordinates are
/// merged, those without a face left out; polygons become fans of triangles. `name` stands for the file in messages.
/// Throws std::runtime_error, one line, where the bytes are no mesh of this format with one face at least.
inline TriangleMesh parse_mesh(std::string_view bytes, MeshFormat format, std::string_view name) {
  switch (format) {
    case MeshFormat::Ply:
      return detail::PlyReader(bytes, name).read();
    case MeshFormat::Obj:
      return detail::parse_obj(bytes, name);
    case MeshFormat::Stl:
      break;
  }
  return detail::parse_stl(bytes, name);
}

/// Reads a .ply, .obj or .stl file of up to 1 GiB; see parse_mesh. Materials, colours and normals are passed over.
/// Throws std::runtime_error, one line that names the file.
inline TriangleMesh read_mesh(const std::filesystem::path& path) {
  const auto format = detail::mesh_format(path);
  if (!format) {
    detail::refuse_file(path.string() + ": name of a mesh file", "ending in .ply, .obj or .stl",
                        detail::visible_text(path.extension().string()));
  }
  return parse_mesh(detail::read_text_file(path, std::uintmax_t{1} << 30), *format, path.string());
}

/// Writes a .ply (binary, double precision: reads back as the same numbers) or .stl (binary, single precision, each
/// triangle with corners of its own). Throws std::invalid_argument if the mesh does not validate, std::runtime_error,
/// one line, if the file cannot be written or has another ending.
inline void write_mesh(const std::filesystem::path& path, const TriangleMesh& mesh) {
  validate(mesh);
  const auto format = detail::mesh_format(path);
  std::string bytes;
  if (format == MeshFormat::Ply) {
    bytes = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(mesh.vertices.size()) +
            "\nproperty double x\nproperty double y\nproperty double z\nelement face " +
            std::to_string(mesh.triangles.size()) + "\nproperty list uchar uint vertex_indices\nend_header\n";
    bytes.reserve(bytes.size() + 24 * mesh.vertices.size() + 13 * mesh.triangles.size());
    for (const Vector3<double>& vertex : mesh.vertices) {
      for (Index axis = 0; axis < 3; ++axis) {
        detail::append_little_endian(bytes, vertex[axis]);
      }
    }
    for (const TriangleMesh::Triangle& triangle : mesh.triangles) {
      bytes.push_back(3);
      for (const std::uint32_t vertex : triangle) {
        detail::append_little_endian(bytes, vertex);
      }
    }
  } else if (format == MeshFormat::Stl) {
    bytes = "binary STL written by decant";
    bytes.resize(80, ' ');
    detail::append_little_endian(bytes, static_cast<std::uint32_t>(mesh.triangles.size()));
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      const Vector3<double> normal = mesh.area_normal(t).stableNormalized();
      for (const Vector3<double>& x : {normal, mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)}) {
        for (Index axis = 0; axis < 3; ++axis) {
          detail::append_little_endian(bytes, static_cast<float>(x[axis]));
        }
      }
      bytes.append(2, '\0');
    }
  } else {
    detail::refuse_file(path.string() + ": name of a mesh file to write", "ending in .ply or .stl",
                        detail::visible_text(path.extension().string()));
  }
  detail::write_text_file(path, bytes);
}

}  // namespace decant::inline DECANT_TARGET
