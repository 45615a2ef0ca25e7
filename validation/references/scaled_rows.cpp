#include <cmath>
#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/validation/references/scaled_rows.hpp>
#include <utility>

namespace diracstep {

namespace {

std::vector<std::string> renamed(std::vector<std::string> names, const std::string& suffix) {
  for (std::string& name : names) name += suffix;
  return names;
}

class ScaledRows final : public ConstraintRows {
 public:
  ScaledRows(std::shared_ptr<const ConstraintRows> rows, double factor, const std::string& suffix)
      : ConstraintRows(rows->holonomic(), rows->pattern(), rows->curvature_pattern(),
                       renamed(rows->names(), suffix)),
        rows_(std::move(rows)),
        factor_(factor) {}

  bool workless() const override { return rows_->workless(); }
  void position(double t, ConstVectorRef q, VectorRef phi) const override {
    rows_->position(t, q, phi);
    phi *= factor_;
  }
  void coefficients(double t, ConstVectorRef q, VectorRef a, VectorRef b) const override {
    rows_->coefficients(t, q, a, b);
    a *= factor_;
    b *= factor_;
  }
  void derivative(double t, ConstVectorRef q, ConstVectorRef w, double s, VectorRef d) const override {
    rows_->derivative(t, q, w, s, d);
    d *= factor_;
  }
  void time_derivative(double t, ConstVectorRef q, ConstVectorRef v, VectorRef d) const override {
    rows_->time_derivative(t, q, v, d);
    d *= factor_;
  }
  void annihilator_derivative(double t, ConstVectorRef q, ConstVectorRef lambda, VectorRef d) const override {
    rows_->annihilator_derivative(t, q, lambda, d);
    d *= factor_;
  }

 private:
  std::shared_ptr<const ConstraintRows> rows_;
  double factor_;
};

}  // namespace

std::shared_ptr<const ConstraintRows> scaled_rows(std::shared_ptr<const ConstraintRows> rows, double factor,
                                                  const std::string& suffix) {
  if (!std::isfinite(factor) || factor == 0.0)
    throw Misuse("rows scaled by " + std::to_string(factor) + "; a finite factor other than 0 is needed");
  return std::make_shared<const ScaledRows>(std::move(rows), factor, suffix);
}

}  // namespace diracstep
