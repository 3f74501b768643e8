// SPDX-License-Identifier: MIT
#pragma once

/// A report in one HTML file that needs no network: text, tables, charts, pictures and a film to scrub through.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <decant/core/expects.hpp>
#include <decant/core/target.hpp>
#include <decant/io/detail/text.hpp>
#include <decant/io/png.hpp>
#include <decant/io/table.hpp>

namespace decant::inline DECANT_TARGET {

/// Lines over a common axis.
struct LineChart {
  struct Line {
    std::string name;
    std::vector<double> x, y;  ///< of equal length; the line breaks where a number is not finite
    bool dashed = false;
    int colour_of = -1;  ///< the line, by its place in the chart, whose colour it has; -1: one of its own
  };

  std::string title;
  std::string x_label;  ///< with unit, e.g. "time [s]"
  std::string y_label;
  std::vector<Line> lines;
  std::vector<double> x_within{};  ///< numbers that the axis shows in any case, such as where a film begins and ends
  std::vector<double> y_within{};  ///< likewise, such as 0 and 1 for a share
  bool over_time = true;           ///< x is the time that the report's film has, which is marked in the chart
};

/// Groups of bars that stand on a common axis.
struct BarChart {
  struct Bars {
    std::string name;
    std::vector<double> heights;  ///< one per group; there is no bar where a number is not finite
  };

  std::string title;
  std::string x_label;  ///< of what groups differ in
  std::string y_label;  ///< with unit
  std::vector<std::string> groups;
  std::vector<Bars> bars;          ///< in each group in this order
  std::vector<double> y_within{};  ///< numbers that the axis shows in any case, beside 0
};

namespace detail {

inline std::string html_text(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

/// Inside of a script's double quotes.
inline std::string script_text(std::string_view text) {
  constexpr char digits[] = "0123456789abcdef";
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\' || c == '<' || byte < 0x20) {  // '<' could end the script
      out += "\\u00";
      out += digits[byte >> 4];
      out += digits[byte & 15U];
    } else {
      out += c;
    }
  }
  return out;
}

inline std::string base64(std::string_view bytes) {
  constexpr char letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t k = 0; k < bytes.size(); k += 3) {
    const auto byte = [&](std::size_t n) {
      return k + n < bytes.size() ? static_cast<unsigned>(static_cast<unsigned char>(bytes[k + n])) : 0U;
    };
    const unsigned group = (byte(0) << 16) | (byte(1) << 8) | byte(2);
    out += letters[(group >> 18) & 63U];
    out += letters[(group >> 12) & 63U];
    out += k + 1 < bytes.size() ? letters[(group >> 6) & 63U] : '=';
    out += k + 2 < bytes.size() ? letters[group & 63U] : '=';
  }
  return out;
}

/// Round numbers that cover [low, high] in about `count` steps, and how many digits tell them apart.
struct Ticks {
  double first = 0, step = 1, last = 1;
  int digits = 0;

  Ticks(double low, double high, int count) {
    if (!(high > low)) {  // one value, or none
      const double middle = std::isfinite(low) ? low : 0.0;
      const double margin = std::max(1.0, std::abs(middle)) * 0.5;
      low = middle - margin;
      high = middle + margin;
    }
    const double raw = (high - low) / count;
    const double power = std::pow(10.0, std::floor(std::log10(raw)));
    const double mantissa = raw / power;
    step = power * (mantissa <= 1 ? 1 : mantissa <= 2 ? 2 : mantissa <= 5 ? 5 : 10);
    first = std::floor(low / step + 1e-9) * step;
    last = std::ceil(high / step - 1e-9) * step;
    digits = std::clamp(static_cast<int>(-std::floor(std::log10(step) + 1e-9)), 0, 12);
  }

  std::vector<double> values() const {
    std::vector<double> out;
    const auto count = static_cast<int>(std::lround((last - first) / step));
    for (int k = 0; k <= count; ++k) {
      out.push_back(first + k * step);
    }
    return out;
  }

  // Very large and very small numbers would fill the margin with zeros.
  std::string text(double value) const {
    const double largest = std::max(std::abs(first), std::abs(last));
    if (largest < 1e6 && digits <= 6) {
      return fixed_text(std::abs(value) < 1e-9 * step ? 0.0 : value, digits);
    }
    char buffer[32];
    const auto [end, error] = std::to_chars(buffer, buffer + sizeof buffer, value, std::chars_format::general, 4);
    return error == std::errc() ? std::string(buffer, end) : std::string();
  }
};

/// At most about 2 `bins` points that draw the same line: the lowest and highest of each bin.
inline LineChart::Line thinned(const LineChart::Line& line, std::size_t bins) {
  if (line.x.size() <= 2 * bins) {
    return line;
  }
  LineChart::Line out{line.name, {}, {}, line.dashed, line.colour_of};
  for (std::size_t bin = 0; bin < bins; ++bin) {
    const std::size_t begin = bin * line.x.size() / bins, end = (bin + 1) * line.x.size() / bins;
    std::size_t low = begin, high = begin;
    bool gap = false;
    for (std::size_t k = begin; k < end; ++k) {
      gap = gap || !std::isfinite(line.y[k]);
      // written so that a missing value never stays chosen
      low = line.y[k] < line.y[low] || !std::isfinite(line.y[low]) ? k : low;
      high = line.y[k] > line.y[high] || !std::isfinite(line.y[high]) ? k : high;
    }
    for (const std::size_t k : {std::min(low, high), std::max(low, high)}) {
      out.x.push_back(line.x[k]);
      out.y.push_back(line.y[k]);
    }
    if (gap) {
      out.x.push_back(line.x[end - 1]);
      out.y.push_back(std::numeric_limits<double>::quiet_NaN());
    }
  }
  return out;
}

/// Of a chart's n-th series. The colours are those of Okabe and Ito (2008), which also those tell apart who do not see
/// red against green; their yellow is left out, which is faint on white.
inline const char* series_color(std::size_t n) {
  constexpr std::array<const char*, 7> colors = {"#0072b2", "#e69f00", "#009e73", "#cc79a7",
                                                 "#1c232b", "#56b4e9", "#d55e00"};
  return colors[n % colors.size()];
}

inline std::string line_style(const LineChart& chart, std::size_t n) {
  const LineChart::Line& line = chart.lines[n];
  const std::size_t colour = line.colour_of < 0 ? n : static_cast<std::size_t>(line.colour_of);
  return " class=\"line\" data-name=\"" + html_text(line.name) + "\" stroke=\"" + series_color(colour) + "\"" +
         (line.dashed ? " stroke-dasharray=\"6 4\"" : "");
}

/// In HTML, not in the drawing: it breaks into rows where there is little room.
inline std::string chart_legend(const LineChart& chart) {
  std::string out = "<div class=\"legend\">";
  for (std::size_t n = 0; n < chart.lines.size(); ++n) {
    out += "<span><svg width=\"26\" height=\"10\" aria-hidden=\"true\"><line" + line_style(chart, n) +
           " x1=\"1\" x2=\"25\" y1=\"5\" y2=\"5\"/></svg>" + html_text(chart.lines[n].name) + "</span>";
  }
  return out + "</div>\n";
}

inline std::string bar_chart_legend(const BarChart& chart) {
  std::string out = "<div class=\"legend\">";
  for (std::size_t n = 0; n < chart.bars.size(); ++n) {
    if (chart.bars[n].name.empty()) {  // the only ones, as a rule: nothing is to be told apart
      continue;
    }
    out += std::string("<span><i style=\"background:") + series_color(n) + "\"></i>" + html_text(chart.bars[n].name) +
           "</span>";
  }
  return out + "</div>\n";
}

/// A drawing's size and how close its labels stand. A chart is drawn twice, since the letters of a wide one shrink too
/// much on a telephone.
struct ChartShape {
  const char* kind;
  double width, height, left, right, top, bottom;
  int x_ticks, y_ticks;
};
inline constexpr ChartShape wide_chart{"wide", 880, 310, 70, 16, 14, 48, 10, 6};
inline constexpr ChartShape narrow_chart{"narrow", 360, 270, 54, 8, 12, 46, 5, 5};

/// What all charts have: the vertical axis with its grid, and the names of both axes.
struct ChartFrame {
  ChartShape shape;
  Ticks y_ticks;

  static std::string point(double value) { return fixed_text(value, 1); }
  double y_at(double y) const {
    return shape.height - shape.bottom -
           (y - y_ticks.first) / (y_ticks.last - y_ticks.first) * (shape.height - shape.top - shape.bottom);
  }

  std::string begin(const std::string& title, const std::string& attributes) const {
    std::string svg = std::string("<svg class=\"chart ") + shape.kind + "\" viewBox=\"0 0 " +
                      fixed_text(shape.width, 0) + " " + fixed_text(shape.height, 0) + "\" role=\"img\" aria-label=\"" +
                      html_text(title) + "\"" + attributes + ">\n";
    for (const double y : y_ticks.values()) {
      svg += "<line class=\"" + std::string(std::abs(y) < 1e-9 * y_ticks.step ? "zero" : "grid") + "\" x1=\"" +
             point(shape.left) + "\" x2=\"" + point(shape.width - shape.right) + "\" y1=\"" + point(y_at(y)) +
             "\" y2=\"" + point(y_at(y)) + "\"/><text text-anchor=\"end\" x=\"" + point(shape.left - 8) + "\" y=\"" +
             point(y_at(y) + 4) + "\">" + y_ticks.text(y) + "</text>\n";
    }
    return svg;
  }

  std::string below(double x, const std::string& text) const {
    return "<text text-anchor=\"middle\" x=\"" + point(x) + "\" y=\"" + point(shape.height - shape.bottom + 18) +
           "\">" + html_text(text) + "</text>\n";
  }

  std::string names(const std::string& x_label, const std::string& y_label) const {
    return "<text text-anchor=\"middle\" x=\"" + point((shape.left + shape.width - shape.right) / 2) + "\" y=\"" +
           point(shape.height - 8) + "\">" + html_text(x_label) +
           "</text>\n<text text-anchor=\"middle\" transform=\"translate(16," +
           point((shape.top + shape.height - shape.bottom) / 2) + ") rotate(-90)\">" + html_text(y_label) + "</text>\n";
  }
};

inline std::string bar_chart_svg(const BarChart& chart, const ChartShape& shape = wide_chart) {
  double low = 0, high = 0;
  const auto include = [&](double y) {
    low = std::isfinite(y) ? std::min(low, y) : low;
    high = std::isfinite(y) ? std::max(high, y) : high;
  };
  for (const BarChart::Bars& bars : chart.bars) {
    std::for_each(bars.heights.begin(), bars.heights.end(), include);
  }
  std::for_each(chart.y_within.begin(), chart.y_within.end(), include);
  const ChartFrame frame{shape, Ticks(low, high, shape.y_ticks)};
  const auto point = ChartFrame::point;
  std::string svg = frame.begin(chart.title, "");
  const double group_width =
      (shape.width - shape.left - shape.right) / static_cast<double>(std::max<std::size_t>(1, chart.groups.size()));
  const double bar_width = 0.8 * group_width / static_cast<double>(std::max<std::size_t>(1, chart.bars.size()));
  for (std::size_t group = 0; group < chart.groups.size(); ++group) {
    const double begin = shape.left + static_cast<double>(group) * group_width;
    svg += frame.below(begin + 0.5 * group_width, chart.groups[group]);
    for (std::size_t n = 0; n < chart.bars.size(); ++n) {
      const double height = chart.bars[n].heights[group];
      if (std::isfinite(height)) {
        const double from = frame.y_at(std::max(0.0, height)), to = frame.y_at(std::min(0.0, height));
        svg += "<rect fill=\"" + std::string(series_color(n)) + "\" x=\"" +
               point(begin + 0.1 * group_width + static_cast<double>(n) * bar_width) + "\" y=\"" + point(from) +
               "\" width=\"" + point(0.92 * bar_width) + "\" height=\"" + point(to - from) + "\"/>\n";
      }
    }
  }
  return svg + frame.names(chart.x_label, chart.y_label) + "</svg>\n";
}

inline std::string chart_svg(const LineChart& chart, const ChartShape& shape = wide_chart) {
  const double width = shape.width, height = shape.height, left = shape.left, right = shape.right, top = shape.top,
               bottom = shape.bottom;
  double x_low = std::numeric_limits<double>::infinity(), x_high = -x_low, y_low = x_low, y_high = -x_low;
  for (const LineChart::Line& line : chart.lines) {
    for (std::size_t k = 0; k < line.x.size(); ++k) {
      if (std::isfinite(line.x[k]) && std::isfinite(line.y[k])) {
        x_low = std::min(x_low, line.x[k]);
        x_high = std::max(x_high, line.x[k]);
        y_low = std::min(y_low, line.y[k]);
        y_high = std::max(y_high, line.y[k]);
      }
    }
  }
  for (const double x : chart.x_within) {
    x_low = std::isfinite(x) ? std::min(x_low, x) : x_low;
    x_high = std::isfinite(x) ? std::max(x_high, x) : x_high;
  }
  for (const double y : chart.y_within) {
    y_low = std::isfinite(y) ? std::min(y_low, y) : y_low;
    y_high = std::isfinite(y) ? std::max(y_high, y) : y_high;
  }
  const Ticks x_ticks(x_low, x_high, shape.x_ticks);
  const ChartFrame frame{shape, Ticks(y_low, y_high, shape.y_ticks)};
  if (!(x_high > x_low)) {
    x_low = x_ticks.first;
    x_high = x_ticks.last;
  }
  const auto x_at = [&](double x) { return left + (x - x_low) / (x_high - x_low) * (width - left - right); };
  const auto point = ChartFrame::point;
  std::string svg =
      frame.begin(chart.title, !chart.over_time ? std::string()
                                                : " data-low=\"" + number_text(x_low) + "\" data-high=\"" +
                                                      number_text(x_high) + "\" data-left=\"" + point(left) +
                                                      "\" data-right=\"" + point(width - right) + "\"");
  for (const double x : x_ticks.values()) {
    if (x >= x_low - 1e-9 * x_ticks.step && x <= x_high + 1e-9 * x_ticks.step) {
      svg += "<line class=\"grid\" x1=\"" + point(x_at(x)) + "\" x2=\"" + point(x_at(x)) + "\" y1=\"" + point(top) +
             "\" y2=\"" + point(height - bottom) + "\"/>" + frame.below(x_at(x), x_ticks.text(x));
    }
  }
  svg += frame.names(chart.x_label, chart.y_label);
  for (std::size_t n = 0; n < chart.lines.size(); ++n) {
    const LineChart::Line line = thinned(chart.lines[n], 1000);
    std::string path;
    bool drawing = false;
    for (std::size_t k = 0; k < line.x.size(); ++k) {
      if (!std::isfinite(line.x[k]) || !std::isfinite(line.y[k])) {
        drawing = false;
        continue;
      }
      path += (drawing ? "L" : "M") + point(x_at(line.x[k])) + " " + point(frame.y_at(line.y[k]));
      drawing = true;
    }
    svg += "<path" + line_style(chart, n) + " d=\"" + path + "\"/>\n";
  }
  svg += "<line class=\"now\" x1=\"-9\" x2=\"-9\" y1=\"" + point(top) + "\" y2=\"" + point(height - bottom) +
         "\"/>\n</svg>\n";
  return svg;
}

}  // namespace detail

/// Put together from the top down, then written. All text is escaped.
class HtmlReport {
 public:
  struct Frame {
    double time = 0;     ///< [s]
    std::string png;     ///< a file's bytes, see png_bytes
    std::string note{};  ///< shown beside the time
  };

  struct Film {
    std::string name;
    std::vector<Frame> frames;
  };

  /// A picture in a grid.
  struct Cell {
    std::string png;  ///< a file's bytes; empty: only the caption is there
    std::string caption;
    std::string link{};  ///< where a click leads to, such as film_link()
  };

  struct GridRow {
    std::string name;
    std::vector<Cell> cells;
  };

  /// How a table is set, beside its cells.
  struct TableLook {
    /// Headings above the header, each with the number of columns that it spans; those of no text are left open.
    std::vector<std::pair<std::string, std::size_t>> groups{};
    std::vector<std::pair<std::size_t, std::size_t>> bold{};  ///< row and column; the header is row 0
  };

  explicit HtmlReport(std::string title) : title_(std::move(title)) {}

  void heading(const std::string& text) { body_ += "<h2>" + detail::html_text(text) + "</h2>\n"; }
  void paragraph(const std::string& text) { body_ += "<p>" + detail::html_text(text) + "</p>\n"; }

  void table(const Table& table) { this->table(table, {}); }

  void table(const Table& table, const TableLook& look) {
    body_ += "<div class=\"scroll\"><table>\n";
    if (!look.groups.empty()) {
      body_ += "<tr class=\"groups\">";
      for (const auto& [text, columns] : look.groups) {
        body_ += (text.empty() ? "<td colspan=\"" : "<th colspan=\"") + std::to_string(columns) + "\">" +
                 (text.empty() ? "</td>" : "<span>" + detail::html_text(text) + "</span></th>");
      }
      body_ += "</tr>\n";
    }
    for (std::size_t r = 0; r < table.rows().size(); ++r) {
      const char* cell = r == 0 ? "th" : "td";
      body_ += "<tr>";
      for (std::size_t column = 0; column < table.rows()[r].size(); ++column) {
        const bool bold = std::find(look.bold.begin(), look.bold.end(), std::pair(r, column)) != look.bold.end();
        body_ += std::string("<") + cell + (bold ? " class=\"bold\">" : ">") +
                 detail::html_text(table.rows()[r][column]) + "</" + cell + ">";
      }
      body_ += "</tr>\n";
    }
    body_ += "</table></div>\n";
  }

  void chart(const LineChart& chart) {
    for (const LineChart::Line& line : chart.lines) {
      expects(line.x.size() == line.y.size(), "LineChart: numbers of x and y of a line", "equal, y has", line.y.size());
    }
    figure(chart.title, detail::chart_legend(chart) + detail::chart_svg(chart, detail::wide_chart) +
                            detail::chart_svg(chart, detail::narrow_chart));
  }

  void bar_chart(const BarChart& chart) {
    for (const BarChart::Bars& bars : chart.bars) {
      expects(bars.heights.size() == chart.groups.size(), "BarChart: number of heights", "that of groups",
              bars.heights.size());
    }
    figure(chart.title, detail::bar_chart_legend(chart) + detail::bar_chart_svg(chart, detail::wide_chart) +
                            detail::bar_chart_svg(chart, detail::narrow_chart));
  }

  /// @param picture a Picture or a PalettePicture.
  template <class AnyPicture>
  void picture(const AnyPicture& picture, const std::string& caption) {
    body_ += "<figure><img alt=\"" + detail::html_text(caption) + "\" src=\"data:image/png;base64," +
             detail::base64(png_bytes(picture)) + "\"><figcaption>" + detail::html_text(caption) +
             "</figcaption></figure>\n";
  }

  /// What the colours of pictures stand for.
  void legend(const std::vector<std::pair<std::string, std::array<std::uint8_t, 3>>>& entries) {
    body_ += "<div class=\"legend\">";
    for (const auto& [name, colour] : entries) {
      body_ += "<span><i style=\"background:rgb(" + std::to_string(colour[0]) + "," + std::to_string(colour[1]) + "," +
               std::to_string(colour[2]) + ")\"></i>" + detail::html_text(name) + "</span>";
    }
    body_ += "</div>\n";
  }

  /// Pictures in rows and columns, to compare. @param columns their headings.
  void grid(const std::vector<std::string>& columns, const std::vector<GridRow>& rows, const std::string& caption) {
    body_ += "<figure><div class=\"scroll\"><table class=\"grid-of-pictures\">\n<tr>";
    for (const std::string& column : columns) {
      body_ += "<th>" + detail::html_text(column) + "</th>";
    }
    body_ += "</tr>\n";
    for (const GridRow& row : rows) {
      body_ += "<tr><th class=\"name\" colspan=\"" + std::to_string(std::max<std::size_t>(1, columns.size())) +
               "\"><span>" + detail::html_text(row.name) + "</span></th></tr>\n<tr>";
      for (const Cell& cell : row.cells) {
        const std::string caption_text = detail::html_text(cell.caption);
        const std::string image = cell.png.empty()
                                      ? std::string()
                                      : "<img alt=\"" + detail::html_text(row.name) + ", " + caption_text +
                                            "\" src=\"data:image/png;base64," + detail::base64(cell.png) + "\">";
        body_ += "<td>" +
                 (cell.link.empty() ? image : "<a href=\"" + detail::html_text(cell.link) + "\">" + image + "</a>") +
                 caption_text + "</td>";
      }
      body_ += "</tr>\n";
    }
    body_ += "</table></div><figcaption>" + detail::html_text(caption) + "</figcaption></figure>\n";
  }

  /// Pictures in order of time with a slider below them; a mark in every chart, whose x axis should be the same time,
  /// follows the slider. One film, or set of films, per report.
  void film(const std::vector<Frame>& frames, const std::string& caption) { films({{"", frames}}, caption); }

  /// Films of the same times, of which one is shown: a list lets the reader choose by name. In charts, lines that have
  /// the chosen film's name are drawn stronger. @param start the picture that is shown first, counted from 0. Throws
  /// std::invalid_argument where films differ in length.
  void films(const std::vector<Film>& all, const std::string& caption, std::size_t start = 0) {
    if (all.empty() || all.front().frames.empty()) {
      return;
    }
    const std::size_t count = all.front().frames.size();
    std::string list, options, times;
    for (const Film& film : all) {
      expects(film.frames.size() == count, "HtmlReport: frames of each film", "as many as of the first",
              film.frames.size());
      std::string images, notes;
      for (const Frame& frame : film.frames) {
        images += (images.empty() ? "\"" : ",\n\"") + detail::base64(frame.png) + "\"";
        notes += (notes.empty() ? "\"" : ",\"") + detail::script_text(frame.note) + "\"";
      }
      list += std::string(list.empty() ? "" : ",\n") + "{name: \"" + detail::script_text(film.name) + "\", notes: [" +
              notes + "],\nimages: [" + images + "]}";
      options += "<option>" + detail::html_text(film.name) + "</option>";
    }
    for (const Frame& frame : all.front().frames) {
      times += (times.empty() ? "" : ",") + detail::fixed_text(frame.time, 3);
    }
    body_ += "<figure id=\"film-figure\"><div class=\"bar\"" + std::string(all.size() > 1 ? "" : " hidden") +
             "><label for=\"choice\">Show</label><select id=\"choice\">" + options +
             "</select></div><div class=\"screen\"><img id=\"film\" alt=\"" + detail::html_text(caption) +
             "\"></div><div class=\"bar\"><button id=\"play\" type=\"button\">Play</button><input id=\"scrub\" "
             "type=\"range\" min=\"0\" max=\"" +
             std::to_string(count - 1) + "\" value=\"" + std::to_string(start) +
             "\" aria-label=\"frame\"></div><output id=\"time\" for=\"scrub\"></output><figcaption>" +
             detail::html_text(caption) + "</figcaption></figure>\n";
    script_ = "<script>\n'use strict';\n{\nconst films = [" + list + "];\nconst times = [" + times + "];\n" +
              film_script() + "}\n</script>\n";
  }

  /// The address, inside of the page, of a picture of a film, both counted from 0.
  static std::string film_link(std::size_t film, std::size_t picture) {
    return "#film=" + std::to_string(film) + "&picture=" + std::to_string(picture);
  }

  std::string text() const {
    return "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"viewport\" "
           "content=\"width=device-width, initial-scale=1\">\n<title>" +
           detail::html_text(title_) + "</title>\n<style>\n" + style() + "</style>\n</head>\n<body>\n<h1>" +
           detail::html_text(title_) + "</h1>\n" + body_ + script_ + "</body>\n</html>\n";
  }

  /// Throws std::runtime_error where the file cannot be written.
  void write(const std::filesystem::path& path) const { detail::write_text_file(path, text()); }

 private:
  void figure(const std::string& title, const std::string& content) {
    body_ +=
        "<figure><figcaption class=\"title\">" + detail::html_text(title) + "</figcaption>\n" + content + "</figure>\n";
  }

  static const char* style() {
    return R"(body{font:16px/1.5 system-ui,sans-serif;color:#1c232b;background:#fff;max-width:920px;margin:2em auto;padding:0 1em}
h1{font-size:1.6em;line-height:1.25;margin-bottom:.3em}h2{font-size:1.2em;margin:2em 0 .5em}p{max-width:44em}
.scroll{overflow-x:auto}
table{border-collapse:collapse;font-size:.94em;font-variant-numeric:tabular-nums}
th,td{padding:.35em 0 .35em 1.1em;text-align:right;vertical-align:bottom;border-bottom:1px solid #dfe4ea}
th{font-weight:500;color:#4a5563;border-bottom-color:#9aa5b1}td,.groups th{white-space:nowrap}.bold{font-weight:700}
th:first-child,td:first-child{text-align:left;padding-left:0;position:sticky;left:0;background:#fff}
.groups th,.groups td{border:0;padding-bottom:0}.groups th{text-align:left}
.groups span{display:block;border-bottom:1px solid #dfe4ea}
figure{margin:1.4em 0}figcaption{color:#4a5563;font-size:.92em}figcaption.title{color:#1c232b;font-size:1em;font-weight:500}
img{max-width:100%}
.legend{display:flex;flex-wrap:wrap;gap:.1em 1.4em;color:#4a5563;font-size:.88em;margin:.3em 0}
.legend span{display:inline-flex;align-items:center;gap:.45em}
.legend i{width:1em;height:1em;border-radius:2px;box-shadow:inset 0 0 0 1px #0003}
.chart{width:100%;height:auto;font:12px system-ui,sans-serif;fill:#4a5563;font-variant-numeric:tabular-nums}
.grid{stroke:#e6eaef}.zero{stroke:#9aa5b1}.line{fill:none;stroke-width:1.6;stroke-linejoin:round}
.strong{stroke-width:3}.now{stroke:#1c232b;stroke-dasharray:2 3}
.narrow{display:none}
.screen{border:1px solid #dfe4ea;border-radius:4px;text-align:center;line-height:0}
.screen img{max-height:65vh;object-fit:contain}
.bar{display:flex;gap:.8em;align-items:center;margin:.6em 0}.bar[hidden]{display:none}
.bar input{flex:1;min-width:6em;accent-color:#0072b2}
button,select{font:inherit;color:inherit;background:#fff;border:1px solid #9aa5b1;border-radius:4px;padding:.25em .8em}
button{min-width:5.2em}
#time{display:block;font-variant-numeric:tabular-nums;margin-bottom:.4em}
.grid-of-pictures{width:100%;min-width:40em;table-layout:fixed;font-size:.84em}
.grid-of-pictures th,.grid-of-pictures td{padding:.2em .25em;text-align:center;border:0;position:static;color:#4a5563}
.grid-of-pictures .name{text-align:left;color:#1c232b;padding-top:.8em}.name span{position:sticky;left:0}
.grid-of-pictures img{display:block;width:100%;border-radius:3px;box-shadow:0 0 0 1px #dfe4ea;margin-bottom:.2em}
.grid-of-pictures a:hover img{box-shadow:0 0 0 2px #0072b2}
@media (max-width:600px){.wide{display:none}.narrow{display:block}body{margin:1em auto}}
@media print{.bar{display:none}}
)";
  }

  static const char* film_script() {
    return R"(const part = name => document.getElementById(name);
const film = part('film'), scrub = part('scrub'), play = part('play'), label = part('time'), choice = part('choice');
const charts = document.querySelectorAll('.chart[data-low]');  // those over time
let timer = null;
// whole steps of screen pixels keep edges crisp
function fit() {
  if (!film.naturalWidth) return;
  const room = Math.min(film.parentNode.clientWidth / film.naturalWidth, 0.65 * innerHeight / film.naturalHeight);
  const zoom = Math.floor(room * devicePixelRatio) / devicePixelRatio;
  film.style.width = zoom >= 1 ? zoom * film.naturalWidth + 'px' : '';
  film.style.imageRendering = zoom >= 1 ? 'pixelated' : '';
}
function show() {
  const k = Number(scrub.value), chosen = films[choice.selectedIndex];
  film.src = 'data:image/png;base64,' + chosen.images[k];
  label.textContent = times[k].toFixed(2) + ' s' + (chosen.notes[k] ? ' \u00b7 ' + chosen.notes[k] : '');
  scrub.setAttribute('aria-valuetext', label.textContent);
  for (const chart of charts) {
    const d = chart.dataset, low = Number(d.low), high = Number(d.high);
    const x = Number(d.left) + (times[k] - low) / (high - low) * (d.right - d.left);
    const inside = times[k] >= low && times[k] <= high;
    for (const end of ['x1', 'x2']) chart.querySelector('.now').setAttribute(end, inside ? x : -9);
  }
}
function choose() {
  for (const line of document.querySelectorAll('.line')) {
    line.classList.toggle('strong', films.length > 1 && line.dataset.name === films[choice.selectedIndex].name);
  }
  show();
}
function go_to(k) {
  scrub.value = Math.min(Math.max(k, 0), times.length - 1);
  show();
}
function stop() {
  clearInterval(timer);
  timer = null;
  play.textContent = 'Play';
}
function toggle() {
  if (timer) return stop();
  play.textContent = 'Pause';
  timer = setInterval(() => go_to((Number(scrub.value) + 1) % times.length),
                      1000 * Math.max(0.02, (times[times.length - 1] - times[0]) / times.length));
}
// addresses such as #film=1&picture=12
function follow_address() {
  const wish = new URLSearchParams(location.hash.slice(1));
  if (!wish.has('film') && !wish.has('picture')) return;
  stop();
  choice.selectedIndex = Math.min(Math.max(Number(wish.get('film')) || 0, 0), films.length - 1);
  go_to(Number(wish.get('picture')) || 0);
  choose();
  part('film-figure').scrollIntoView({block: 'nearest'});
}
function seek(chart, event) {
  const d = chart.dataset, box = chart.getBoundingClientRect();
  const x = (event.clientX - box.left) / box.width * chart.viewBox.baseVal.width;
  const time = Number(d.low) + (x - d.left) / (d.right - d.left) * (d.high - d.low);
  let nearest = 0;
  times.forEach((t, k) => { if (Math.abs(t - time) < Math.abs(times[nearest] - time)) nearest = k; });
  stop();
  go_to(nearest);
}
film.addEventListener('load', fit);
window.addEventListener('resize', fit);
scrub.addEventListener('input', show);
choice.addEventListener('change', choose);
play.addEventListener('click', toggle);
window.addEventListener('hashchange', follow_address);
// a link that is followed twice changes nothing in the address
document.addEventListener('click', event => { if (event.target.closest('a')) setTimeout(follow_address); });
for (const chart of charts) {
  chart.addEventListener('pointerdown', event => seek(chart, event));
  chart.addEventListener('pointermove', event => { if (event.buttons & 1) seek(chart, event); });
}
document.addEventListener('keydown', event => {
  const step = {ArrowLeft: -1, ArrowRight: 1}[event.key];
  // the slider has keys of its own
  if (!step || event.target === scrub || event.ctrlKey || event.altKey || event.metaKey) return;
  event.preventDefault();
  stop();
  go_to(Number(scrub.value) + step);
});
choose();
follow_address();
)";
  }

  std::string title_;
  std::string body_;
  std::string script_;
};

}  // namespace decant::inline DECANT_TARGET
