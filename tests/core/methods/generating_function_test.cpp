#include <gtest/gtest.h>

#include <diracstep/core/methods/adjoint.hpp>
#include <diracstep/core/methods/registry.hpp>

#include "differences.hpp"
#include "methods.hpp"
#include "scenes.hpp"

namespace diracstep {
namespace {

/// Every method, and the adjoint of each that has one by name.
std::vector<std::string> methods_and_adjoints() {
  std::vector<std::string> names;
  const Registry registry = Registry::with_built_ins();
  for (const std::string& name : testing::every_method()) {
    const MethodInfo info = registry.method(name).info;
    if (!info.type) continue;  // nor a generating function
    names.push_back(name);
    if (info.rows_inside) continue;  // its own adjoint
    const int type = static_cast<int>(adjoint_type(*info.type));
    names.push_back("type" + std::to_string(type) + "/adjoint(" + name + ")");
  }
  return names;
}

class GeneratingFunctionLaws : public ::testing::TestWithParam<std::string> {};

TEST_P(GeneratingFunctionLaws, DerivativesAgreeWithDifferences) {
  const auto s = Registry::with_built_ins().method(GetParam()).generating_function(*testing::unconstrained());
  const int n = s->dimension(), c = s->columns();
  const Interval step{0.0, 0.3};
  std::srand(7);
  const Columns y = Columns::Random(n, c);
  const auto value = [&](const Vector& x) { return Vector::Constant(1, s->value(step, x.reshaped(n, c))); };
  const auto gradient = [&](const Vector& x) {
    Columns g(n, c);
    s->gradient(step, x.reshaped(n, c), g);
    return Vector(g.reshaped());
  };
  const Vector x = y.reshaped();
  EXPECT_LT((gradient(x).transpose() - testing::difference_jacobian(value, x)).cwiseAbs().maxCoeff(), 1e-7);
  const Eigen::MatrixXd expected = testing::difference_jacobian(gradient, x);
  Columns blocks(s->pattern().nonzeros(), s->pairs());
  s->hessian(step, y, blocks);
  for (int i = 0; i < c; ++i)
    for (int j = i; j < c; ++j) {
      const Eigen::MatrixXd block = testing::full(s->pattern(), blocks.col(s->pair(i, j)));
      EXPECT_LT((block - expected.block(n * i, n * j, n, n)).cwiseAbs().maxCoeff(), 1e-7) << i << " " << j;
    }
}

INSTANTIATE_TEST_SUITE_P(EveryMethod, GeneratingFunctionLaws, ::testing::ValuesIn(methods_and_adjoints()),
                         [](const auto& test) { return testing::test_name(test.param); });

}  // namespace
}  // namespace diracstep
