// SPDX-License-Identifier: MIT
#pragma once

/// Work in a process of its own, so that its peak of memory is its own.

#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <cstring>
#include <exception>
#include <stdexcept>
#include <string>
#include <type_traits>

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

namespace decant_benchmark {

template <class Value>
struct ChildResult {
  Value value{};
  double peak_mb = 0;  ///< most memory that was resident at once [MB = 1e6 bytes]; holds what the parent had
};

/// Calls f() in a child process and returns its result, which is copied byte by byte. The parent must not have run
/// loops on several threads before: of OpenMP's threads the child would inherit the name only, and wait for them for
/// ever. Throws std::runtime_error if the child fails, after it has said why on its standard error.
template <class Function>
auto in_child_process(Function&& f) {
  using Value = decltype(f());
  static_assert(std::is_trivially_copyable_v<Value>);
  int ends[2];
  std::fflush(nullptr);  // or the child would print what is buffered once more
  if (pipe(ends) != 0) {
    throw std::runtime_error(std::string("pipe: ") + std::strerror(errno));
  }
  const pid_t child = fork();
  if (child < 0) {
    throw std::runtime_error(std::string("fork: ") + std::strerror(errno));
  }
  if (child == 0) {
    int status = 1;
    try {
      const Value value = f();
      status = write(ends[1], &value, sizeof value) == static_cast<ssize_t>(sizeof value) ? 0 : 1;
    } catch (const std::exception& error) {
      std::fprintf(stderr, "%s\n", error.what());
    }
    std::fflush(nullptr);
    _exit(status);
  }
  close(ends[1]);
  ChildResult<Value> result;
  std::size_t got = 0;
  for (ssize_t more = 1; more > 0 && got < sizeof(Value); got += static_cast<std::size_t>(more > 0 ? more : 0)) {
    more = read(ends[0], reinterpret_cast<char*>(&result.value) + got, sizeof(Value) - got);
  }
  close(ends[0]);
  int status = 0;
  rusage usage{};
  if (wait4(child, &status, 0, &usage) != child || status != 0 || got != sizeof(Value)) {
    throw std::runtime_error("a child process failed");
  }
  result.peak_mb = 1e-6 * 1024 * static_cast<double>(usage.ru_maxrss);  // in units of 1024 bytes on Linux
  return result;
}

}  // namespace decant_benchmark
