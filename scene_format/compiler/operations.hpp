#pragma once

#include <cmath>
#include <diracstep/scene_format/compiler/formula_graph.hpp>
#include <diracstep/scene_format/compiler/special_functions.hpp>

namespace diracstep::scene_compiler {

/// The value of a computing operation.
template <class T>
T computed(const NodeData& node, T a, T b) {
  switch (node.op) {
    case Op::negative:
      return -a;
    case Op::add:
      return a + b;
    case Op::subtract:
      return a - b;
    case Op::multiply:
      return a * b;
    case Op::divide:
      return a / b;
    case Op::power:
      return whole_power(a, node.c);
    case Op::pow:
      return std::pow(a, b);
    case Op::sqrt:
      return std::sqrt(a);
    case Op::sin:
      return std::sin(a);
    case Op::cos:
      return std::cos(a);
    case Op::tan:
      return std::tan(a);
    case Op::asin:
      return std::asin(a);
    case Op::acos:
      return std::acos(a);
    case Op::atan:
      return std::atan(a);
    case Op::atan2:
      return std::atan2(a, b);
    case Op::sinh:
      return std::sinh(a);
    case Op::cosh:
      return std::cosh(a);
    case Op::tanh:
      return std::tanh(a);
    case Op::asinh:
      return std::asinh(a);
    case Op::acosh:
      return std::acosh(a);
    case Op::atanh:
      return std::atanh(a);
    case Op::exp:
      return std::exp(a);
    case Op::log:
      return std::log(a);
    case Op::abs:
      return std::abs(a);
    case Op::sign:
      return a > T(0) ? T(1) : a < T(0) ? T(-1) : T(0);
    case Op::min:
      return a < b || std::isnan(a) ? a : b;
    case Op::max:
      return a > b || std::isnan(a) ? a : b;
    case Op::floor:
      return std::floor(a);
    case Op::hypot:
      return std::hypot(a, b);
    case Op::where:
      return a > T(0) ? b : a < T(0) ? T(0) : b / T(2);
    case Op::kepler_E:
      return static_cast<T>(kepler_anomaly(a, b));
    case Op::sn:
      return static_cast<T>(jacobi_elliptic(a, b).sn);
    case Op::cn:
      return static_cast<T>(jacobi_elliptic(a, b).cn);
    case Op::dn:
      return static_cast<T>(jacobi_elliptic(a, b).dn);
    default:
      return T(0);  // leaves are read, never computed
  }
}

}  // namespace diracstep::scene_compiler
