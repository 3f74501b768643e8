// SPDX-License-Identifier: MIT
#pragma once

/// A report in one HTML file that needs no network: text, tables, line charts, pictures and a film to scrub through.

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
#include <decant/io/detail/text.hpp>
#include <decant/io/png.hpp>
#include <decant/io/table.hpp>

namespace decant {

/// Lines over a common axis.
struct LineChart {
  struct Line {
    std::string name;
    std::vector<double> x, y;  ///< of equal length; the line breaks where a number is not finite
    bool dashed = false;
  };

  std::string title;
  std::string x_label;  ///< with unit, e.g. "time [s]"
  std::string y_label;
  std::vector<Line> lines;
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
  LineChart::Line out{line.name, {}, {}, line.dashed};
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

inline std::string chart_svg(const LineChart& chart) {
  constexpr double width = 880, height = 330, left = 70, right = 16, top = 34, bottom = 48;
  // told apart also by those who do not see red against green
  constexpr std::array<const char*, 7> colors = {"#1f5fbf", "#d9730d", "#1a8a5a", "#8e3fb0",
                                                 "#b3261e", "#5a6472", "#0f8ea0"};
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
  const Ticks x_ticks(x_low, x_high, 10), y_ticks(y_low, y_high, 6);
  if (!(x_high > x_low)) {
    x_low = x_ticks.first;
    x_high = x_ticks.last;
  }
  const auto x_at = [&](double x) { return left + (x - x_low) / (x_high - x_low) * (width - left - right); };
  const auto y_at = [&](double y) {
    return height - bottom - (y - y_ticks.first) / (y_ticks.last - y_ticks.first) * (height - top - bottom);
  };
  const auto point = [](double value) { return fixed_text(value, 1); };

  std::string svg = "<svg class=\"chart\" viewBox=\"0 0 880 330\" role=\"img\" aria-label=\"" + html_text(chart.title) +
                    "\" data-low=\"" + number_text(x_low) + "\" data-high=\"" + number_text(x_high) +
                    "\" data-left=\"" + point(left) + "\" data-right=\"" + point(width - right) + "\">\n";
  for (const double y : y_ticks.values()) {
    svg += "<line class=\"" + std::string(std::abs(y) < 1e-9 * y_ticks.step ? "zero" : "grid") + "\" x1=\"" +
           point(left) + "\" x2=\"" + point(width - right) + "\" y1=\"" + point(y_at(y)) + "\" y2=\"" + point(y_at(y)) +
           "\"/><text text-anchor=\"end\" x=\"" + point(left - 8) + "\" y=\"" + point(y_at(y) + 4) + "\">" +
           y_ticks.text(y) + "</text>\n";
  }
  for (const double x : x_ticks.values()) {
    if (x >= x_low - 1e-9 * x_ticks.step && x <= x_high + 1e-9 * x_ticks.step) {
      svg += "<line class=\"grid\" x1=\"" + point(x_at(x)) + "\" x2=\"" + point(x_at(x)) + "\" y1=\"" + point(top) +
             "\" y2=\"" + point(height - bottom) + "\"/><text text-anchor=\"middle\" x=\"" + point(x_at(x)) +
             "\" y=\"" + point(height - bottom + 18) + "\">" + x_ticks.text(x) + "</text>\n";
    }
  }
  svg += "<text text-anchor=\"middle\" x=\"" + point((left + width - right) / 2) + "\" y=\"" + point(height - 8) +
         "\">" + html_text(chart.x_label) + "</text>\n<text text-anchor=\"middle\" transform=\"translate(16," +
         point((top + height - bottom) / 2) + ") rotate(-90)\">" + html_text(chart.y_label) + "</text>\n";
  double legend = left;
  for (std::size_t n = 0; n < chart.lines.size(); ++n) {
    const LineChart::Line line = thinned(chart.lines[n], 1000);
    const std::string style =
        std::string(" stroke=\"") + colors[n % colors.size()] + "\"" + (line.dashed ? " stroke-dasharray=\"6 4\"" : "");
    std::string path;
    bool drawing = false;
    for (std::size_t k = 0; k < line.x.size(); ++k) {
      if (!std::isfinite(line.x[k]) || !std::isfinite(line.y[k])) {
        drawing = false;
        continue;
      }
      path += (drawing ? "L" : "M") + point(x_at(line.x[k])) + " " + point(y_at(line.y[k]));
      drawing = true;
    }
    svg += "<path class=\"line\"" + style + " d=\"" + path + "\"/>\n";
    svg += "<line class=\"line\"" + style + " x1=\"" + point(legend) + "\" x2=\"" + point(legend + 24) +
           "\" y1=\"16\" y2=\"16\"/><text x=\"" + point(legend + 30) + "\" y=\"20\">" + html_text(line.name) +
           "</text>\n";
    legend += 54 + 7.2 * static_cast<double>(line.name.size());
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
    double time = 0;  ///< [s]
    std::string png;  ///< a file's bytes, see png_bytes
  };

  explicit HtmlReport(std::string title) : title_(std::move(title)) {}

  void heading(const std::string& text) { body_ += "<h2>" + detail::html_text(text) + "</h2>\n"; }
  void paragraph(const std::string& text) { body_ += "<p>" + detail::html_text(text) + "</p>\n"; }

  void table(const Table& table) {
    body_ += "<table>\n";
    for (std::size_t r = 0; r < table.rows().size(); ++r) {
      const char* cell = r == 0 ? "th" : "td";
      body_ += "<tr>";
      for (const std::string& text : table.rows()[r]) {
        body_ += std::string("<") + cell + ">" + detail::html_text(text) + "</" + cell + ">";
      }
      body_ += "</tr>\n";
    }
    body_ += "</table>\n";
  }

  void chart(const LineChart& chart) {
    for (const LineChart::Line& line : chart.lines) {
      expects(line.x.size() == line.y.size(), "LineChart: numbers of x and y of a line", "equal, y has", line.y.size());
    }
    body_ += "<figure><figcaption>" + detail::html_text(chart.title) + "</figcaption>\n" + detail::chart_svg(chart) +
             "</figure>\n";
  }

  void picture(const Picture& picture, const std::string& caption) {
    body_ += "<figure><img alt=\"" + detail::html_text(caption) + "\" src=\"data:image/png;base64," +
             detail::base64(png_bytes(picture)) + "\"><figcaption>" + detail::html_text(caption) +
             "</figcaption></figure>\n";
  }

  /// Pictures in order of time with a slider below them; a mark in every chart, whose x axis should be the same time,
  /// follows the slider. One film per report.
  void film(const std::vector<Frame>& frames, const std::string& caption) {
    if (frames.empty()) {
      return;
    }
    std::string images, times;
    for (const Frame& frame : frames) {
      images += (images.empty() ? "\"" : ",\n\"") + detail::base64(frame.png) + "\"";
      times += (times.empty() ? "" : ",") + detail::fixed_text(frame.time, 3);
    }
    body_ +=
        "<figure><img id=\"film\" alt=\"" + detail::html_text(caption) +
        "\"><div class=\"bar\"><button id=\"play\" type=\"button\">Play</button><input id=\"scrub\" type=\"range\" "
        "min=\"0\" max=\"" +
        std::to_string(frames.size() - 1) +
        "\" value=\"0\" aria-label=\"frame\"><output id=\"time\"></output></div><figcaption>" +
        detail::html_text(caption) + "</figcaption></figure>\n";
    script_ = "<script>\nconst images = [" + images + "];\nconst times = [" + times + "];\n" + film_script();
    script_ += "</script>\n";
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
  static const char* style() {
    return "body{font:16px/1.5 system-ui,sans-serif;color:#1c232b;background:#fff;max-width:920px;margin:2em auto;"
           "padding:0 1em}\n"
           "h1{font-size:1.6em;margin-bottom:.3em}h2{font-size:1.2em;margin-top:1.8em}\n"
           "table{border-collapse:collapse;font-variant-numeric:tabular-nums}"
           "th,td{padding:.3em 1.1em .3em 0;text-align:right;border-bottom:1px solid #dfe4ea}"
           "th:first-child,td:first-child{text-align:left}\n"
           "figure{margin:1.2em 0}figcaption{color:#4a5563;font-size:.92em}img{max-width:100%}\n"
           ".chart{width:100%;height:auto;font:12px system-ui,sans-serif;fill:#4a5563}"
           ".grid{stroke:#e6eaef}.zero{stroke:#9aa5b1}.line{fill:none;stroke-width:1.8;stroke-linejoin:round}"
           ".now{stroke:#1c232b;stroke-dasharray:2 3}\n"
           ".bar{display:flex;gap:1em;align-items:center;max-width:640px}.bar input{flex:1}"
           "#time{min-width:5em;text-align:right;font-variant-numeric:tabular-nums}\n";
  }

  static const char* film_script() {
    return "const film = document.getElementById('film'), scrub = document.getElementById('scrub');\n"
           "const play = document.getElementById('play'), label = document.getElementById('time');\n"
           "function show() {\n"
           "  const k = Number(scrub.value);\n"
           "  film.src = 'data:image/png;base64,' + images[k];\n"
           "  label.textContent = times[k].toFixed(2) + ' s';\n"
           "  for (const chart of document.querySelectorAll('.chart')) {\n"
           "    const d = chart.dataset, span = d.high - d.low;\n"
           "    const x = Number(d.left) + (times[k] - d.low) / span * (d.right - d.left);\n"
           "    const inside = times[k] >= Number(d.low) && times[k] <= Number(d.high);\n"
           "    for (const end of ['x1', 'x2']) chart.querySelector('.now').setAttribute(end, inside ? x : -9);\n"
           "  }\n"
           "}\n"
           "scrub.addEventListener('input', show);\n"
           "let timer = null;\n"
           "play.addEventListener('click', () => {\n"
           "  if (timer) { clearInterval(timer); timer = null; play.textContent = 'Play'; return; }\n"
           "  play.textContent = 'Pause';\n"
           "  timer = setInterval(() => { scrub.value = (Number(scrub.value) + 1) % images.length; show(); },\n"
           "                      1000 * Math.max(0.02, (times[times.length - 1] - times[0]) / images.length));\n"
           "});\n"
           "show();\n";
  }

  std::string title_;
  std::string body_;
  std::string script_;
};

}  // namespace decant
