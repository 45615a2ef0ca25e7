#pragma once

#include <diracstep/core/system/phase_function.hpp>

namespace diracstep {

/// First and second derivatives of L at one point, second ones as values on its pattern.
struct LagrangianDerivatives {
  explicit LagrangianDerivatives(const Lagrangian& lagrangian) {
    for (Vector* column : {&q, &v}) column->setZero(lagrangian.dimension());
    for (Vector* values : {&qq, &qv, &vv}) values->setZero(lagrangian.pattern().nonzeros());
  }

  void take_first(const Lagrangian& lagrangian, double t, ConstVectorRef at_q, ConstVectorRef at_v) {
    lagrangian.gradient(t, at_q, at_v, q, v);
  }
  void take_second(const Lagrangian& lagrangian, double t, ConstVectorRef at_q, ConstVectorRef at_v) {
    lagrangian.hessian(t, at_q, at_v, qq, qv, vv);
  }

  Vector q, v, qq, qv, vv;
};

}  // namespace diracstep
