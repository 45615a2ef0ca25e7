#pragma once

#include <diracstep/c_interface/diracstep.h>
#include <diracstep/version.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <initializer_list>
#include <string>
#include <vector>

#include "misuse.hpp"

namespace diracstep::testing {

/// The C interface, from a source to points.
class CInterface : public ::testing::Test {
 protected:
  ~CInterface() override { clear(); }
  void clear() {
    diracstep_destroy(made_);
    diracstep_close(model_);
    made_ = nullptr;
    model_ = nullptr;
  }
  int open(const diracstep_source& source, unsigned version = DIRACSTEP_VERSION_OF_C_INTERFACE) {
    clear();
    return diracstep_open(version, &source, &model_);
  }
  int open(const char* name) {
    diracstep_source source{};
    source.name = name;
    return open(source);
  }
  int create(const diracstep_options& options = {}) {
    diracstep_destroy(made_);
    return diracstep_create(model_, &options, &made_);
  }
  int create(const diracstep_scene* scene, const diracstep_options& options = {}) {
    diracstep_source source{};
    source.callbacks = scene;
    const int status = open(source);
    return status == DIRACSTEP_OK ? create(options) : status;
  }
  static void expect_message(std::initializer_list<std::string> parts) {
    expect_parts(diracstep_message(), parts);
  }
  std::vector<std::string> listed(int what, int column = 0) {
    diracstep_table table{};
    EXPECT_EQ(diracstep_list(model_, what, &table), DIRACSTEP_OK) << diracstep_message();
    std::vector<std::string> texts;
    for (int r = 0; r < table.rows; ++r) texts.emplace_back(table.cells[r * table.columns + column]);
    return texts;
  }
  static bool has(const std::vector<std::string>& texts, const std::string& text) {
    return std::ranges::find(texts, text) != texts.end();
  }
  diracstep_model* model_ = nullptr;
  diracstep_integrator* made_ = nullptr;
};

/// Arrays that grow, for scenes of n coordinates and m rows.
struct Arrays {
  Arrays(int n, int m, long room = 4) : n_(n), m_(m) {
    points.data = this;
    points.enlarge = [](void* data, diracstep_points* into) {
      static_cast<Arrays*>(data)->resize(2 * into->room);
      return 0;
    };
    resize(room);
  }
  void resize(long room) {
    const auto rows = static_cast<std::size_t>(room);
    t.resize(rows);
    energy.resize(rows);
    q.resize(rows * static_cast<std::size_t>(n_));
    v.resize(q.size());
    lambda.resize(rows * static_cast<std::size_t>(m_));
    points.room = room;
    points.t = t.data();
    points.energy = energy.data();
    points.q = q.data();
    points.v = v.data();
    points.lambda = lambda.data();
  }
  double last_q(int i) const { return q[static_cast<std::size_t>((points.count - 1) * n_ + i)]; }

  int n_, m_;
  diracstep_points points{};
  std::vector<double> t, q, v, lambda, energy;
};

inline const char* const spring =
    "name = \"spring\"\nlagrangian = \"v_x^2/2 - x^2/2\"\n[coordinates]\nx = {}\n[start]\nx = 1\n"
    "[invariants]\ntotal = \"v_x^2/2 + x^2/2\"\n[span]\nend = 6.0\nstep = 0.25\n";

/// A ball that bounces: q = (y, n), n counts, and its height and count are outputs.
inline const char* const ball =
    "name = \"ball\"\nlagrangian = \"v_y^2/2 - 9.81*y\"\n[coordinates]\ny = {}\n[states]\nn = {}\n"
    "[start]\ny = 1\n[span]\nend = 1.5\nstep = 0.01\n[outputs]\ncount = \"n\"\ntwice = \"2*y\"\n"
    "[[events]]\nname = \"floor\"\nwhen = \"y\"\nrestitution = 0.5\nset = { n = \"n + 1\" }\n"
    "[[events]]\nname = \"top\"\nwhen = \"v_y\"\ndirection = \"falling\"\nif = \"n > 0.5\"\naction = "
    "\"stop\"\n";

}  // namespace diracstep::testing
