#include <gtest/gtest.h>

#include <diracstep/core/integrator/integrator.hpp>
#include <diracstep/core/steps/matrix_form.hpp>
#include <diracstep/core/system/consistent_start.hpp>
#include <diracstep/core/system/redundant_rows.hpp>
#include <diracstep/scene_format/scene_catalogue.hpp>
#include <diracstep/solvers/kinsol_solver.hpp>

#include "misuse.hpp"

namespace diracstep {
namespace {

std::shared_ptr<const Scene> chain(int links) {
  return completed(make_scene("hanging_chain", {{"N", double(links)}}).scene);
}

TEST(MatrixForm, IsFullForFewUnknownsAndWhereTheFactorsAre) {
  EXPECT_TRUE(matrix_form(*chain(3), as_measured).full) << "9 unknowns";
  EXPECT_FALSE(matrix_form(*chain(12), as_measured).full) << "36 unknowns, a band";
  EXPECT_FALSE(matrix_form(*chain(1000), as_measured).full) << "3000 unknowns";
  const auto planets = completed(make_scene("outer_solar_system", {}).scene);
  const MatrixForm full = matrix_form(*planets, as_measured);
  EXPECT_TRUE(full.full) << "each of 18 unknowns depends on all";
  EXPECT_NE(full.reason.find("100 %"), std::string::npos) << full.reason;
}

TEST(MatrixForm, IsTheOneAskedFor) {
  EXPECT_TRUE(matrix_form(*chain(12), 36).full);
  EXPECT_FALSE(matrix_form(*chain(12), 35).full);
  EXPECT_FALSE(matrix_form(*chain(2), 0).full);
}

TEST(MatrixForm, StandsInThePlanWithItsReason) {
  const Integrator integrator(chain(12), Registry::with_built_ins(), kinsol(), {.step = 1e-3});
  for (const PlanLine& line : integrator.plan())
    if (line.item == "Jacobian") {
      EXPECT_EQ(line.decision, "sparse");
      EXPECT_NE(line.reason.find("of a full matrix"), std::string::npos) << line.reason;
      return;
    }
  FAIL() << "the plan says nothing of the Jacobian";
}

/// One of the rows of a block once more, in units of its own.
class Again final : public ConstraintRows {
 public:
  Again(std::shared_ptr<const ConstraintRows> rows, int row)
      : ConstraintRows(true, pattern_of(*rows, row),
                       SparsityPattern(rows->dimension(), rows->dimension(), {}), {"again"}),
        rows_(std::move(rows)),
        row_(row) {}
  void position(double t, ConstVectorRef q, VectorRef phi) const override {
    Vector all(rows_->rows());
    rows_->position(t, q, all);
    phi[0] = unit * all[row_];
  }
  void coefficients(double t, ConstVectorRef q, VectorRef a, VectorRef b) const override {
    Vector all(rows_->pattern().nonzeros()), offset(rows_->rows());
    rows_->coefficients(t, q, all, offset);
    Eigen::Index k = 0, e = 0;
    for (const auto& [row, column] : rows_->pattern().entries()) {
      if (row == row_) a[e++] = unit * all[k];
      ++k;
    }
    b.setZero();
  }
  void derivative(double, ConstVectorRef, ConstVectorRef, double, VectorRef d) const override { d.setZero(); }
  void time_derivative(double, ConstVectorRef, ConstVectorRef, VectorRef d) const override { d.setZero(); }
  void annihilator_derivative(double, ConstVectorRef, ConstVectorRef, VectorRef d) const override {
    d.setZero();
  }

 private:
  static constexpr double unit = 1e4;
  static SparsityPattern pattern_of(const ConstraintRows& rows, int wanted) {
    std::vector<std::pair<int, int>> entries;
    for (const auto& [row, column] : rows.pattern().entries())
      if (row == wanted) entries.emplace_back(0, column);
    return {1, rows.dimension(), entries};
  }
  std::shared_ptr<const ConstraintRows> rows_;
  int row_;
};

TEST(RedundantRows, AreFoundAmongThousands) {
  const auto scene = std::make_shared<Scene>(*chain(1200));
  EXPECT_TRUE(redundant_rows(*scene, scene->start).empty());
  const auto rows = scene->constraints.front();
  scene->constraints.push_back(std::make_shared<Again>(rows, 700));
  const auto names = redundant_rows(*scene, scene->start);
  ASSERT_EQ(names.size(), 1U);
  EXPECT_TRUE(names[0] == "again" || names[0] == rows->names()[700]) << names[0];
  scene->refuse_redundant_rows = true;
  const auto make = [&](bool drop) {
    return Integrator(scene, Registry::with_built_ins(), kinsol(),
                      {.method = "type1/midpoint", .step = 1e-4, .drop_redundant_rows = drop});
  };
  testing::expect_misuse([&] { (void)make(false); }, {"hanging_chain", "redundant constraints", names[0]});
  Integrator integrator = make(true);
  EXPECT_EQ(integrator.scene().rows(), 1200);
  EXPECT_TRUE(integrator.step().ok());
}

}  // namespace
}  // namespace diracstep
