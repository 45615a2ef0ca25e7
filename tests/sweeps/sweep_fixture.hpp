#pragma once

#include <gtest/gtest.h>

#include <diracstep/solvers/kinsol_solver.hpp>
#include <diracstep/sweeps/sweep_folder.hpp>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "temporary_folder.hpp"

namespace diracstep::testing {

/// A folder of its own for each test, removed afterwards.
class SweepTest : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const { return folder_.path(name); }
  std::string write(const std::string& name, const std::string& text) const {
    return folder_.write(name, text);
  }

  static std::vector<std::string> fields(const std::string& line) {
    std::vector<std::string> all;
    std::istringstream stream(line);
    for (std::string field; std::getline(stream, field, ',');) all.push_back(field);
    return all;
  }
  std::vector<std::string> rows(const std::string& folder) const {
    std::istringstream stream(contents(path(folder + "/results.csv")));
    std::vector<std::string> all;
    for (std::string line; std::getline(stream, line);) all.push_back(line);
    return all;
  }

  static SweepReport run(const Sweep& sweep, const SweepOptions& options) {
    static const Registry registry = Registry::with_built_ins();
    return run_sweep(
        sweep, [&](const Parameters& changes) { return make_scene(sweep.scene, changes); }, registry,
        kinsol(), options);
  }

 private:
  TemporaryFolder folder_;
};

}  // namespace diracstep::testing
