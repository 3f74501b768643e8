#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Compares two commits by a benchmark: builds both, runs them alternately, and says which figures differ.

  benchmarks/compare_commits.py BEFORE AFTER PROGRAM [options] [-- arguments of the program]
  benchmarks/compare_commits.py HEAD~1 HEAD bench_neighbor_search --runs 10 -- --threads 1 --sizes 20

Runs go A B, B A, A B, ..., so that a drift of the machine's speed favours neither; each pair gives one ratio per
figure. Printed are the medians, the median ratio AFTER / BEFORE, and an interval that holds the true median ratio with
a confidence of at least 95 % whatever the distribution of the noise (order statistics; six pairs are the least that
can say so). A figure whose interval contains 1 is inside the noise. BEFORE and AFTER may be the same commit, which
shows how much noise there is.
"""

import argparse
import csv
import math
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

TIMES = {"s", "ms", "us", "ns", "s/s"}


class Failure(Exception):
    """Something that is said in one line."""


def run(command, **settings):
    """Runs a command; what it printed is shown only if it fails."""
    done = subprocess.run([str(word) for word in command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                          check=False, **settings)
    if done.returncode != 0:
        sys.stderr.write("\n".join(done.stdout.splitlines()[-30:]) + "\n")
        raise Failure(f"failed: {' '.join(str(word) for word in command)}")
    return done.stdout


class Version:
    """A commit, in a worktree of its own, and its build."""

    def __init__(self, repository, folder, role, name):
        self.repository = repository
        self.commit = run(["git", "-C", repository, "rev-parse", "--verify", "--quiet", f"{name}^{{commit}}"]).strip()
        self.source = folder / f"{role}-{self.commit[:10]}-source"
        self.build_folder = folder / f"{role}-{self.commit[:10]}-build"
        self.figures = {}

    def check_out(self, benchmarks_of=None):
        run(["git", "-C", self.repository, "worktree", "add", "--force", "--detach", self.source, self.commit])
        if benchmarks_of is not None:
            shutil.rmtree(self.source / "benchmarks")
            run(["git", "-C", self.source, "checkout", benchmarks_of, "--", "benchmarks"])

    def build(self, program, options, jobs):
        generator = ["-G", "Ninja"] if shutil.which("ninja") else []
        run(["cmake", "-S", self.source, "-B", self.build_folder, *generator, "-DCMAKE_BUILD_TYPE=Release",
             "-DDECANT_BUILD_TESTS=OFF", "-DDECANT_BUILD_EXAMPLES=OFF", "-DDECANT_BUILD_BENCHMARKS=ON", *options])
        parallel = ["--parallel", jobs] if jobs else ["--parallel"]
        run(["cmake", "--build", self.build_folder, "--target", program, *parallel])

    def measure(self, program, arguments):
        """Runs the program once and returns its figures: {(case, size, threads, unit): value}."""
        results = self.build_folder / "results.csv"
        results.unlink(missing_ok=True)
        run([self.build_folder / "benchmarks" / program, *arguments, "--csv", results], cwd=self.source)
        with open(results, newline="", encoding="utf-8") as file:
            return {(row["case"], row["size"], row["threads"], row["unit"]): float(row["median"])
                    for row in csv.DictReader(file)}

    def remove(self, keep_build):
        if self.source.exists():
            subprocess.run(["git", "-C", self.repository, "worktree", "remove", "--force", self.source], check=False)
        if not keep_build:
            shutil.rmtree(self.build_folder, ignore_errors=True)


def confidence_interval(ratios):
    """Between two order statistics, as narrow as 95 % allow, and its confidence; the sign test turned around."""
    ratios = sorted(ratios)
    count = len(ratios)
    outside = 0.0
    best = (ratios[0], ratios[-1], 1 - 2 / 2**count)
    for left_out in range(1, count // 2 + 1):
        outside += math.comb(count, left_out - 1) / 2**count
        if 1 - 2 * outside < 0.95:
            break
        best = (ratios[left_out - 1], ratios[count - left_out], 1 - 2 * outside)
    return best


def verdict(low, high, unit):
    if low <= 1 <= high:
        return "inside the noise"
    if unit in TIMES:
        return "faster" if high < 1 else "slower"
    return "less" if high < 1 else "more"


def report(pairs, out=sys.stdout):
    """Prints a line for each figure. @param pairs [(figures before, figures after), ...]."""
    first_before, first_after = pairs[0]
    width = max([len(case) for case, *_ in first_before] + [4])
    print(f"{'case':{width}}  {'size':>8} {'threads':>7} {'before':>10} {'after':>10} {'unit':4}  ratio [interval]",
          file=out)
    confidence = None
    for figure in first_before:
        case, size, threads, unit = figure
        both = [(before[figure], after[figure]) for before, after in pairs if figure in before and figure in after]
        if not both:
            print(f"{case:{width}}  only before", file=out)
            continue
        middle = [statistics.median(values) for values in zip(*both)]
        line = f"{case:{width}}  {size:>8} {threads:>7} {middle[0]:10.4g} {middle[1]:10.4g} {unit:4}"
        if all(before > 0 and after > 0 for before, after in both):
            ratios = [after / before for before, after in both]
            low, high, confidence = confidence_interval(ratios)
            line += f"  {statistics.median(ratios):.3f} [{low:.3f} .. {high:.3f}]  {verdict(low, high, unit)}"
        print(line, file=out)
    for figure in first_after:
        if figure not in first_before:
            print(f"{figure[0]:{width}}  only after", file=out)
    if confidence is not None:
        print(f"{len(pairs)} pairs of runs; the intervals' confidence is {100 * confidence:.1f} %", file=out)


def parse_arguments():
    own, program_arguments = sys.argv[1:], []
    if "--" in own:
        program_arguments = own[own.index("--") + 1:]
        own = own[:own.index("--")]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("before", help="a commit")
    parser.add_argument("after", help="another one")
    parser.add_argument("program", help="a benchmark, such as bench_kernels")
    parser.add_argument("--runs", type=int, default=6, metavar="N", help="runs of each commit (default 6)")
    parser.add_argument("--same-benchmarks", action="store_true", help="build both with the benchmarks of AFTER")
    parser.add_argument("--cmake", action="append", default=[], metavar="OPTION",
                        help="for CMake, such as --cmake=-DCMAKE_CXX_COMPILER=clang++; may be repeated")
    parser.add_argument("--jobs", type=int, metavar="N", help="compilers that run side by side (default: all cores)")
    parser.add_argument("--folder", type=Path, help="for worktrees and builds (default: a temporary one)")
    parser.add_argument("--keep", action="store_true", help="keep the builds; with --folder they are used again")
    options = parser.parse_args(own)
    if options.runs < 1:
        parser.error("--runs must be at least 1")
    return options, program_arguments


def main():
    options, program_arguments = parse_arguments()
    repository = Path(__file__).resolve().parent.parent
    folder = (options.folder or Path(tempfile.mkdtemp(prefix="decant-compare-"))).resolve()
    folder.mkdir(parents=True, exist_ok=True)
    versions = []
    try:
        for role, name in (("before", options.before), ("after", options.after)):
            versions.append(Version(repository, folder, role, name))
        for version in versions:
            print(f"building {version.commit[:10]}", file=sys.stderr)
            version.check_out(versions[1].commit if options.same_benchmarks else None)
            version.build(options.program, options.cmake, options.jobs)
        pairs = []
        for k in range(options.runs):
            order = versions if k % 2 == 0 else versions[::-1]
            for version in order:
                version.figures = version.measure(options.program, program_arguments)
            pairs.append((versions[0].figures, versions[1].figures))
            print(f"run {k + 1} of {options.runs}", file=sys.stderr)
        report(pairs)
    except Failure as failure:
        print(f"compare_commits.py: {failure}", file=sys.stderr)
        return 1
    finally:
        for version in versions:
            version.remove(options.keep)
        if not options.keep and options.folder is None:
            shutil.rmtree(folder, ignore_errors=True)
        elif options.keep:
            print(f"builds are in {folder}", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main())
