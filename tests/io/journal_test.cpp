// SPDX-License-Identifier: MIT
// Journals: bits that come back, runs that are killed, last lines that are not whole, files that are something else.

#include <decant/io/journal.hpp>

#include <algorithm>
#include <csignal>
#include <cstddef>
#include <filesystem>
#include <random>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <sys/wait.h>
#include <unistd.h>

#include <decant/hypothesis/thread_executor.hpp>
#include <decant/testing/executor.hpp>

#include "catch.hpp"
#include "temporary_folder.hpp"

using decant::JobResult;
using decant::Journal;
using decant::run_journaled;
using decant::tell_nobody;
using decant::ThreadExecutor;
using decant::testing::fragile_result;
using decant::testing::same_bits;

namespace {

std::string text_of(const std::filesystem::path& path) { return decant::detail::read_text_file(path, 1 << 20); }

std::vector<std::string> keys_up_to(std::size_t count) {
  std::vector<std::string> keys;
  for (std::size_t k = 0; k < count; ++k) {
    keys.push_back("job " + std::to_string(k));
  }
  return keys;
}

/// What opening a file with this text as a journal of "settings" says.
std::string refusal_of_journal(const decant_test::TemporaryFolder& folder, const std::string& text) {
  const auto path = folder.write("refused.journal", text);
  const std::string message = decant_test::message_of([&] { const Journal journal(path, "settings"); });
  CHECK(text_of(path) == text);
  CHECK(message.find('\n') == std::string::npos);
  if (message.empty()) {
    return message;
  }
  CHECK(message.find(path.string()) == 0);
  return message.substr(path.string().size());
}

}  // namespace

TEST_CASE("journal: results and keys come back to the bit") {
  const decant_test::TemporaryFolder folder("journal_bits");
  const auto path = folder.path() / "a.journal";
  const std::vector<std::string> keys{"", "plain", "tab\tand\\t", "line\nand\\n\r", "\\", "ünï", "cells,\"quoted\""};
  const std::string fingerprint = "{\"spacing\": 0.004,\n\t\"path\": \"C:\\temp\"}";
  {
    Journal journal(path, fingerprint);
    CHECK(journal.size() == 0);
    for (std::size_t k = 0; k < keys.size(); ++k) {
      journal.add(keys[k], fragile_result(k));
    }
  }
  const Journal again(path, fingerprint);
  CHECK(again.size() == keys.size());
  for (std::size_t k = 0; k < keys.size(); ++k) {
    INFO(k);
    REQUIRE(again.find(keys[k]) != nullptr);
    CHECK(same_bits(*again.find(keys[k]), fragile_result(k)));
  }
  CHECK(again.find("other") == nullptr);
}

TEST_CASE("journal: a key has one result") {
  const decant_test::TemporaryFolder folder("journal_one");
  Journal journal(folder.path() / "a.journal", "settings");
  journal.add("a", {1});
  CHECK_THROWS_WITH(journal.add("a", {2}), decant_test::contains("Journal: key must be one that has no result yet"));
  CHECK(*Journal(folder.path() / "a.journal", "settings").find("a") == JobResult{1});
}

TEST_CASE("journal: wherever a file breaks off, whole lines are kept and the sweep goes on") {
  const decant_test::TemporaryFolder folder("journal_torn");
  const auto path = folder.path() / "a.journal";
  std::vector<std::size_t> ends;  // of lines, in bytes
  {
    Journal journal(path, "settings");
    ends.push_back(text_of(path).size());
    for (std::size_t k = 0; k < 4; ++k) {
      journal.add("job " + std::to_string(k), fragile_result(k));
      ends.push_back(text_of(path).size());
    }
  }
  const std::string whole = text_of(path);
  REQUIRE(ends.back() == whole.size());
  const std::vector<std::string> keys = keys_up_to(4);
  for (std::size_t length = 0; length <= whole.size(); ++length) {
    INFO(length);
    folder.write("a.journal", whole.substr(0, length));
    const auto lines = std::count_if(ends.begin(), ends.end(), [&](std::size_t end) { return end <= length; });
    Journal journal(path, "settings");
    CHECK(journal.size() == static_cast<std::size_t>(std::max<std::ptrdiff_t>(lines - 1, 0)));
    ThreadExecutor executor{{1}};
    std::size_t ran = 0;
    const auto results = run_journaled(
        executor, journal, keys,
        [&](std::size_t k) {
          ++ran;
          return fragile_result(k);
        },
        tell_nobody);
    CHECK(ran == 4 - static_cast<std::size_t>(std::max<std::ptrdiff_t>(lines - 1, 0)));
    CHECK(text_of(path) == whole);
  }
}

TEST_CASE("journal: only what is missing runs, and is told") {
  const decant_test::TemporaryFolder folder("journal_missing");
  for (const int threads : {1, 2, 4}) {
    const auto path = folder.path() / (std::to_string(threads) + ".journal");
    Journal journal(path, "settings");
    journal.add("job 3", fragile_result(3));
    journal.add("job 0", fragile_result(0));
    journal.add("of another sweep", {7});
    ThreadExecutor executor{{threads}};
    std::vector<int> ran(6), told(6);
    const auto work = [&](std::size_t k) {
      ++ran[k];
      return fragile_result(k);
    };
    const auto count_told = [&](std::size_t k, const JobResult& result) {
      ++told[k];
      CHECK(same_bits(result, fragile_result(k)));
    };
    for (int round = 0; round < 2; ++round) {  // in the second, nothing is missing
      const auto results = run_journaled(executor, journal, keys_up_to(6), work, count_told);
      REQUIRE(results.size() == 6);
      for (std::size_t k = 0; k < 6; ++k) {
        CHECK(same_bits(results[k], fragile_result(k)));
      }
      CHECK(ran == std::vector<int>{0, 1, 1, 0, 1, 1});
      CHECK(told == ran);
    }
    CHECK(run_journaled(executor, journal, {}, work, count_told).empty());
    CHECK_THROWS_WITH(run_journaled(executor, journal, {"a", "b", "a"}, work, count_told),
                      decant_test::contains("keys must be all different, got a"));
  }
}

TEST_CASE("journal: a job that throws leaves the results before it in the file") {
  const decant_test::TemporaryFolder folder("journal_throws");
  const auto path = folder.path() / "a.journal";
  ThreadExecutor executor{{1}};
  {
    Journal journal(path, "settings");
    const auto work = [](std::size_t k) { return k == 2 ? throw std::out_of_range("two") : fragile_result(k); };
    CHECK_THROWS_AS(run_journaled(executor, journal, keys_up_to(4), work, tell_nobody), std::out_of_range);
  }
  CHECK(Journal(path, "settings").size() == 2);
}

TEST_CASE("journal: a sweep whose process is killed goes on where it was") {
  const decant_test::TemporaryFolder folder("journal_killed");
  const auto path = folder.path() / "a.journal";
  const auto sweep = [&](std::size_t kill_in, std::vector<std::size_t>& ran) {
    ThreadExecutor executor{{1}};
    Journal journal(executor, path, "settings");
    return run_journaled(
        executor, journal, keys_up_to(20),
        [&](std::size_t k) {
          if (k == kill_in) {
            std::raise(SIGKILL);
          }
          ran.push_back(k);
          return fragile_result(k);
        },
        tell_nobody);
  };
  std::vector<std::size_t> ran;
  const pid_t child = fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    static_cast<void>(sweep(13, ran));
    _exit(0);  // it was not killed
  }
  int status = 0;
  REQUIRE(waitpid(child, &status, 0) == child);
  REQUIRE(WIFSIGNALED(status));
  CHECK(WTERMSIG(status) == SIGKILL);

  const auto results = sweep(99, ran);
  CHECK(ran == std::vector<std::size_t>{13, 14, 15, 16, 17, 18, 19});
  REQUIRE(results.size() == 20);
  for (std::size_t k = 0; k < 20; ++k) {
    CHECK(same_bits(results[k], fragile_result(k)));
  }
}

TEST_CASE("journal: results of something else are refused") {
  const decant_test::TemporaryFolder folder("journal_fingerprint");
  const std::string header = "decant journal 1\t";
  CHECK(refusal_of_journal(folder, header + "others\na\t1\t2\n") ==
        ": fingerprint must be \"settings\", got \"others\": results of something else");
  // where long ones differ is shown
  const std::string same(500, 'x');
  const auto path = folder.write("long.journal", header + same + "0.004" + same + "\n");
  const std::string message = decant_test::message_of([&] { const Journal journal(path, same + "0.005" + same); });
  CHECK(message.find("x0.005x") != std::string::npos);
  CHECK(message.find("x0.004x") != std::string::npos);
  CHECK(message.size() < path.string().size() + 350);
}

TEST_CASE("journal: files that are none, or are damaged, are refused and left as they are") {
  const decant_test::TemporaryFolder folder("journal_refused");
  const std::string header = "decant journal 1\tsettings\n";
  CHECK(refusal_of_journal(folder, header + "a\t1\t2\na\t1\t2\n").empty());  // said twice, by two runs at once
  CHECK(refusal_of_journal(folder, "a table\n1,2\n") == ": line 1 must be \"decant journal 1\", got \"a table\\x0a\"");
  CHECK(refusal_of_journal(folder, "notes of mine") ==
        ": line 1 must be the beginning of a journal, got \"notes of mine\"");
  CHECK(refusal_of_journal(folder, "decant journal 2\tsettings\n").find("line 1 must be \"decant journal 1\"") !=
        std::string::npos);
  CHECK(refusal_of_journal(folder, "decant journal 1\n").find("line 1 must be \"decant journal 1\"") !=
        std::string::npos);
  const std::string sentence = ": line 3 must be a key, a count, and as many numbers, got \"";
  for (const char* line : {"b", "b\t", "b\t1", "b\t2\t1", "b\t1\t1\t2", "b\tx\t1", "b\t-1", "b\t1\tx", "b\t1\tnan",
                           "b\t1\t", "b\t1\t1 ", "b\t1\t#", "b\t1\t#xyz", "b\t1\t#1234567890abcdef0", "\\q\t1\t1",
                           "b\\\t1\t1", "", "b\t99999999999999999999\t1", "b\t1\t1e999"}) {
    INFO(line);
    CHECK(refusal_of_journal(folder, header + "a\t1\t2\n" + line + "\nc\t1\t2\n").find(sentence) == 0);
  }
  CHECK(refusal_of_journal(folder, header + "a\t1\t0\na\t1\t-0\n") ==
        ": line 3 must be of a new key, or what was there before, got \"a\\x091\\x09-0\"");

  const auto in_no_folder = folder.path() / "none" / "a.journal";
  CHECK(decant_test::message_of([&] { const Journal journal(in_no_folder, ""); }) ==
        in_no_folder.string() + ": cannot be written");
  CHECK(decant_test::message_of([&] { const Journal journal(folder.path(), ""); }).find("no such file") !=
        std::string::npos);
}

TEST_CASE("journal: whatever bytes a file has, it is read or refused") {
  const decant_test::TemporaryFolder folder("journal_bytes");
  const std::string whole = "decant journal 1\tsettings\na\t2\t1.5\t-0\nb\\t\t0\nc\t1\t#7ff0000000000000\n";
  std::mt19937 generator(6);
  int read = 0;
  for (int round = 0; round < 500; ++round) {
    std::string text = whole;
    for (int change = 0; change < 1 + round % 3; ++change) {
      const std::size_t place = 26 * static_cast<std::size_t>(round % 2) + generator() % (text.size() - 26);
      constexpr std::string_view likely{"\t\n\\#-0e\0", 8};
      text[place] = round % 4 < 2 ? likely[generator() % likely.size()] : static_cast<char>(generator() % 256);
    }
    const auto path = folder.write("a.journal", text);
    try {
      const Journal journal(path, "settings");
      ++read;
      CHECK(text_of(path) == text.substr(0, text_of(path).size()));
    } catch (const std::runtime_error& error) {
      CHECK(std::string(error.what()).find('\n') == std::string::npos);
      CHECK(text_of(path) == text);
    }
  }
  CHECK(read > 20);
}
