// SPDX-License-Identifier: MIT
#pragma once

/// What the tools' command lines share.

#include <cstdio>
#include <exception>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "json_result.hpp"

namespace example {

/// Reads the command line, then does the work. What is wrong with either is said in one line.
/// @param work returns the exit status. @return that, or 2 where an argument, a file or the work's input is refused.
inline int run_tool(CLI::App& app, int count, char** values, const std::function<int()>& work) {
  app.failure_message([](const CLI::App*, const CLI::Error& error) { return std::string(error.what()) + "\n"; });
  try {
    app.parse(count, values);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    return work();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
}

/// Does a recorder's work, of which the command line has been read. @return its exit status: 0; 2 where an argument is
/// refused, 1 where the run failed on the way, said in one line.
inline int run_recorder(const std::function<void()>& work) {
  try {
    work();
    return 0;
  } catch (const std::invalid_argument& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}

/// Throws std::runtime_error unless each file that is asked for, by a name that is not empty, can be written.
inline void expect_writable(std::initializer_list<std::string> files) {
  for (const std::string& file : files) {
    if (!file.empty()) {
      expect_writable(std::filesystem::path(file));
    }
  }
}

/// Throws std::runtime_error for a recording that is given twice, or held out of what it is learnt from.
inline void expect_apart(const std::vector<std::string>& learn, const std::vector<std::string>& held_out,
                         const std::vector<std::string>& references = {}) {
  for (const auto& [option, folders] :
       {std::pair("--learn", &learn), std::pair("--held-out", &held_out), std::pair("--reference", &references)}) {
    std::set<std::filesystem::path> different;
    for (const std::string& folder : *folders) {
      if (!different.insert(std::filesystem::weakly_canonical(folder)).second) {
        throw std::runtime_error(std::string(option) + ": " + folder + " is given twice");
      }
    }
  }
  for (const std::string& other : held_out) {
    for (const std::string& folder : learn) {
      if (std::filesystem::weakly_canonical(folder) == std::filesystem::weakly_canonical(other)) {
        throw std::runtime_error("--held-out: " + other + " is among those that are learnt from");
      }
    }
  }
  for (const std::string& reference : references) {
    for (const std::vector<std::string>* folders : {&learn, &held_out}) {
      for (const std::string& folder : *folders) {
        if (std::filesystem::weakly_canonical(folder) == std::filesystem::weakly_canonical(reference)) {
          throw std::runtime_error("--reference: " + reference + " is among those in which something may be missing");
        }
      }
    }
  }
}

}  // namespace example
