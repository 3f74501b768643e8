// SPDX-License-Identifier: MIT
// Reports: escaping, base64, axes, lines that keep their extremes and gaps, nothing fetched from elsewhere.

#include <decant/io/report.hpp>

#include <cmath>
#include <string>
#include <vector>

#include "catch.hpp"
#include "temporary_folder.hpp"

TEST_CASE("report: base64 of RFC 4648") {
  using decant::detail::base64;
  CHECK(base64("").empty());
  CHECK(base64("f") == "Zg==");
  CHECK(base64("fo") == "Zm8=");
  CHECK(base64("foobar") == "Zm9vYmFy");
  CHECK(base64(std::string("\xff\x00\xfe", 3)) == "/wD+");
}

TEST_CASE("report: ticks are round and cover the range") {
  using decant::detail::Ticks;
  const Ticks ticks(-0.3, 28.9, 6);
  CHECK(ticks.step == 5);
  CHECK(ticks.first == -5);
  CHECK(ticks.last == 30);
  CHECK(ticks.values().size() == 8);
  CHECK(ticks.text(5) == "5");
  const Ticks small(0, 0.0123, 6);
  CHECK(small.step == Approx(0.005));
  CHECK(small.text(0.005) == "0.005");
  CHECK(Ticks(0, 3e7, 6).text(1e7) == "1e+07");
  for (const double value : {0.0, 5.0, -3e9, std::nan("")}) {  // no range, or none that is finite
    const Ticks one(value, value, 6);
    INFO(value);
    CHECK(one.last > one.first);
    CHECK(one.values().size() < 20);
  }
}

TEST_CASE("report: a thinned line keeps its highest and lowest points and its gaps") {
  decant::LineChart::Line line;
  for (int k = 0; k < 10000; ++k) {
    line.x.push_back(k);
    line.y.push_back(k == 7777 ? 50 : k == 1234 ? -50 : k == 5000 ? std::nan("") : std::sin(k));
  }
  const auto thin = decant::detail::thinned(line, 100);
  CHECK(thin.x.size() < 310);
  CHECK(std::count(thin.y.begin(), thin.y.end(), 50) == 1);
  CHECK(std::count(thin.y.begin(), thin.y.end(), -50) == 1);
  CHECK(std::any_of(thin.y.begin(), thin.y.end(), [](double y) { return std::isnan(y); }));
  CHECK(std::is_sorted(thin.x.begin(), thin.x.end()));
}

TEST_CASE("report: bars stand on zero, as high as their numbers") {
  const decant::BarChart chart{
      "title", "level", "share", {"a<", "b"}, {{"first", {0.5, 1}}, {"second", {-0.5, std::nan("")}}}, {}};
  const std::string svg = decant::detail::bar_chart_svg(chart);
  // the axis has -0.5 .. 1 over 14 .. 310 - 48: 165.33 px for 1, zero at 179.3
  CHECK(svg.find("y=\"96.7\" width=\"146.1\" height=\"82.7\"") != std::string::npos);
  CHECK(svg.find("y=\"179.3\" width=\"146.1\" height=\"82.7\"") != std::string::npos);
  CHECK(svg.find("y=\"14.0\" width=\"146.1\" height=\"165.3\"") != std::string::npos);
  CHECK(svg.find(">a&lt;</text>") != std::string::npos);
  CHECK(svg.find("nan") == std::string::npos);
  decant::HtmlReport report("bars");
  report.bar_chart(chart);
  CHECK(report.text().find("</i>second</span>") != std::string::npos);
  CHECK_THROWS_WITH(report.bar_chart({"t", "x", "y", {"a"}, {{"n", {}}}, {}}),
                    decant_test::contains("number of heights"));
}

TEST_CASE("report: a chart draws each point where it belongs") {
  const decant::LineChart chart{
      "t",
      "time [s]",
      "height [mm]",
      {{"a", {0, 1, 2, 3, 4}, {0, 10, std::nan(""), 10, 0}, false}, {"b<", {0, 4}, {5, 5}, true}}};
  const std::string svg = decant::detail::chart_svg(chart);
  // x from 70 to 864, y from 262 (0) up to 14 (10); the gap starts a new stroke
  CHECK(svg.find("d=\"M70.0 262.0L268.5 14.0M665.5 14.0L864.0 262.0\"") != std::string::npos);
  CHECK(svg.find("d=\"M70.0 138.0L864.0 138.0\"") != std::string::npos);
  CHECK(svg.find("data-name=\"b&lt;\"") != std::string::npos);
  CHECK(decant::detail::chart_legend(chart).find("</svg>b&lt;</span>") != std::string::npos);
  CHECK(svg.find("time [s]") != std::string::npos);
  CHECK(svg.find("height [mm]") != std::string::npos);
  CHECK(svg.find("nan") == std::string::npos);
  CHECK(decant::detail::chart_svg({"empty", "x", "y", {}}).find("nan") == std::string::npos);
}

TEST_CASE("report: an axis shows the numbers that it is asked to show") {
  decant::LineChart chart{"t", "x", "y", {{"a", {5, 6}, {0.6, 0.7}, false}}};
  CHECK(decant::detail::chart_svg(chart).find(">0.0<") == std::string::npos);
  chart.y_within = {0, 1, std::nan("")};
  const std::string svg = decant::detail::chart_svg(chart);
  CHECK(svg.find(">0.0<") != std::string::npos);
  CHECK(svg.find(">1.0<") != std::string::npos);
  CHECK(svg.find("data-high=\"6\"") != std::string::npos);
  chart.x_within = {9};
  CHECK(decant::detail::chart_svg(chart).find("data-high=\"9\"") != std::string::npos);
}

TEST_CASE("report: a line has a colour of its own, or another one's") {
  const decant::LineChart chart{
      "t", "x", "y", {{"a", {0, 1}, {0, 1}}, {"b", {0, 1}, {1, 2}}, {"of b", {0, 1}, {2, 3}, true, 1}}};
  const std::string svg = decant::detail::chart_svg(chart), own = decant::detail::series_color(1);
  const auto times = [&](const std::string& colour) {
    std::size_t count = 0;
    for (std::size_t at = svg.find(colour); at != std::string::npos; at = svg.find(colour, at + 1)) {
      ++count;
    }
    return count;
  };
  CHECK(times(own) == 2);
  CHECK(times(decant::detail::series_color(0)) == 1);
  CHECK(times(decant::detail::series_color(2)) == 0);
}

TEST_CASE("report: only charts over time follow a film") {
  decant::LineChart chart{"t", "amount [ml]", "y", {{"a", {5, 6}, {0.6, 0.7}, false}}};
  const auto svg = [&] { return decant::detail::chart_svg(chart); };
  CHECK(svg().find(" data-low=\"5\" data-high=\"6\"") != std::string::npos);
  chart.over_time = false;
  CHECK(svg().find("data-low") == std::string::npos);
  CHECK(svg().find("<path class=\"line\"") != std::string::npos);
}

TEST_CASE("report: text is escaped and nothing is fetched from elsewhere") {
  const decant_test::TemporaryFolder folder("report");
  decant::HtmlReport report("a <b> & c");
  report.heading("h<1>");
  report.paragraph("\"quoted\" & <script>");
  decant::Table table({"name", "value"});
  table.add({"x<y", "1"});
  report.table(table);
  report.chart({"chart", "x", "y", {{"line", {0, 1}, {0, 1}, false}}});
  decant::Picture picture(2, 2);
  report.picture(picture, "two by two");
  report.legend({{"c&d", {1, 2, 3}}});
  report.grid({"g<"}, {{"row>", {{decant::png_bytes(picture), "\"cell\"", decant::HtmlReport::film_link(1, 2)}}}},
              "i&j");
  report.films({{"one</script>", {{0.0, decant::png_bytes(picture), "\"n\\"}, {0.5, decant::png_bytes(picture)}}},
                {"two", {{0.0, decant::png_bytes(picture)}, {0.5, decant::png_bytes(picture)}}}},
               "film");
  report.write(folder.path() / "r.html");
  const std::string html = decant::detail::read_text_file(folder.path() / "r.html", 1 << 20);
  CHECK(html.find("<h1>a &lt;b&gt; &amp; c</h1>") != std::string::npos);
  CHECK(html.find("<h2>h&lt;1&gt;</h2>") != std::string::npos);
  CHECK(html.find("<p>&quot;quoted&quot; &amp; &lt;script&gt;</p>") != std::string::npos);
  CHECK(html.find("<td>x&lt;y</td><td>1</td>") != std::string::npos);
  CHECK(html.find("const times = [0.000,0.500];") != std::string::npos);
  CHECK(html.find("{name: \"one\\u003c/script>\", notes: [\"\\u0022n\\u005c\",\"\"]") != std::string::npos);
  CHECK(html.find("<option>one&lt;/script&gt;</option><option>two</option>") != std::string::npos);
  CHECK(html.find("rgb(1,2,3)\"></i>c&amp;d</span>") != std::string::npos);
  CHECK(html.find("<th>g&lt;</th>") != std::string::npos);
  CHECK(html.find("row&gt;, &quot;cell&quot;") != std::string::npos);
  CHECK(html.find("<a href=\"#film=1&amp;picture=2\">") != std::string::npos);
  CHECK(html.find("data:image/png;base64,iVBORw0KGgo") != std::string::npos);
  for (const char* foreign : {"http:", "https:", "//cdn", "@import", "<link"}) {
    INFO(foreign);
    CHECK(html.find(foreign) == std::string::npos);
  }
  CHECK_THROWS_WITH(report.chart({"c", "x", "y", {{"line", {0, 1}, {0}, false}}}),
                    "LineChart: numbers of x and y of a line must be equal, y has, got 1");
  CHECK_THROWS_WITH(report.films({{"a", {{0.0, "", ""}}}, {"b", {}}}, "c"),
                    "HtmlReport: frames of each film must be as many as of the first, got 0");
  CHECK_THROWS_AS(report.write(folder.path() / "no/such/folder/r.html"), std::runtime_error);
}

TEST_CASE("report: a table has headings of groups and bold cells where it is asked to") {
  decant::HtmlReport report("t");
  decant::Table table({"name", "a", "b"});
  table.add({"x", "1", "2"});
  report.table(table, {{{"", 1}, {"both & all", 2}}, {{1, 2}}});
  const std::string html = report.text();
  CHECK(html.find("<td colspan=\"1\"></td><th colspan=\"2\"><span>both &amp; all</span></th>") != std::string::npos);
  CHECK(html.find("<td>x</td><td>1</td><td class=\"bold\">2</td>") != std::string::npos);
}
