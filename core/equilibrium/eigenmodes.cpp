#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <diracstep/core/equilibrium/eigenmodes.hpp>
#include <vector>

namespace diracstep {

namespace {

constexpr double zero_eigenvalue = 1e-12;  // of the largest, beside round-off of the matrix
constexpr double zero_real_part = 1e-11;   // of the largest eigenvalue

using ComplexVector = Eigen::VectorXcd;
using Complex = std::complex<double>;

/// Powers of 2 by which the state is scaled, so that rows and columns of D⁻¹ A D are of like size (Parlett
/// and Reinsch, Numer. Math. 13, 1969): entries of different units would hide small eigenvalues.
Vector balancing(Columns& a) {
  Vector scale = Vector::Ones(a.rows());
  for (bool changed = true; changed;) {
    changed = false;
    for (Eigen::Index i = 0; i < a.rows(); ++i) {
      const double column = a.col(i).lpNorm<1>() - std::abs(a(i, i));
      const double row = a.row(i).lpNorm<1>() - std::abs(a(i, i));
      if (column == 0.0 || row == 0.0) continue;
      const double factor = std::exp2(std::round(0.5 * std::log2(row / column)));
      if (factor == 1.0 || column * factor + row / factor >= 0.95 * (column + row)) continue;
      a.col(i) *= factor;
      a.row(i) /= factor;
      scale[i] *= factor;
      changed = true;
    }
  }
  return scale;
}

/// What one kernel was split off with: A = [Z W] [0 coupling; 0 A'] [Z W]ᵀ.
struct Split {
  Columns kernel, rest, coupling;
};

/// Splits kernels off until the rest is regular, and leaves it in `a`.
std::vector<Split> split_zeros(Columns& a) {
  std::vector<Split> splits;
  const double size = a.size() > 0 ? a.norm() : 0.0;
  while (a.cols() > 0) {
    Eigen::ColPivHouseholderQR<Columns> qr(a.transpose());
    const Vector pivots = qr.matrixQR().diagonal().cwiseAbs();
    const Eigen::Index n = a.cols(), rank = (pivots.array() > zero_eigenvalue * size).count();
    if (rank == n) break;
    const Columns all = qr.householderQ() * Columns::Identity(n, n);
    Split split{all.rightCols(n - rank), all.leftCols(rank), {}};
    split.coupling = split.kernel.transpose() * a * split.rest;
    a = Columns(split.rest.transpose() * a * split.rest);
    splits.push_back(std::move(split));
  }
  return splits;
}

/// Of the whole matrix, from one of the rest: Z (coupling x)/λ + W x.
ComplexVector joined(const std::vector<Split>& splits, ComplexVector x, Complex eigenvalue) {
  for (std::size_t k = splits.size(); k-- > 0;) {
    const Split& split = splits[k];
    x = ComplexVector(split.kernel * ComplexVector(split.coupling * x) / eigenvalue + split.rest * x);
  }
  return x;
}

ComplexVector with_largest_one(ComplexVector shape) {
  Eigen::Index largest = 0;
  if (shape.cwiseAbs().maxCoeff(&largest) > 0.0) shape /= Complex(shape[largest]);
  return shape;
}

Eigenmodes of_state(const Linearisation& linear) {
  Columns a = linear.state;
  const Vector scale = balancing(a);
  const std::vector<Split> splits = split_zeros(a);
  Eigenmodes found;
  found.zeros = static_cast<int>(linear.state.cols() - a.cols());
  if (a.cols() == 0) return found;
  const Eigen::EigenSolver<Columns> solved(a);
  const double round_off = 1e-14 * solved.eigenvalues().cwiseAbs().maxCoeff();
  for (Eigen::Index k = 0; k < a.cols(); ++k) {
    Complex eigenvalue = solved.eigenvalues()[k];
    if (eigenvalue.imag() < 0.0) continue;
    if (std::abs(eigenvalue.real()) <= round_off) eigenvalue = {0.0, eigenvalue.imag()};
    const ComplexVector state = scale.asDiagonal() * joined(splits, solved.eigenvectors().col(k), eigenvalue);
    found.modes.push_back(
        {eigenvalue, with_largest_one(linear.positions * state.head(linear.positions.cols()))});
  }
  return found;
}

/// K y = ω² M y.
Eigenmodes of_conservative(const Linearisation& linear) {
  const Eigen::GeneralizedSelfAdjointEigenSolver<Columns> solved(linear.stiffness, linear.mass);
  const Vector& squares = solved.eigenvalues();
  const double largest = squares.cwiseAbs().maxCoeff();
  Eigenmodes found;
  for (Eigen::Index k = 0; k < squares.size(); ++k) {
    if (std::abs(squares[k]) <= zero_eigenvalue * largest) {
      found.zeros += 2;
      continue;
    }
    const double rate = std::sqrt(std::abs(squares[k]));
    const ComplexVector shape =
        with_largest_one((linear.positions * solved.eigenvectors().col(k)).cast<Complex>());
    if (squares[k] > 0.0) {
      found.modes.push_back({{0.0, rate}, shape});
    } else {
      found.modes.push_back({{rate, 0.0}, shape});
      found.modes.push_back({{-rate, 0.0}, shape});
    }
  }
  return found;
}

bool positive_masses(const Columns& mass) {
  const Eigen::LLT<Columns> factors(mass);
  return factors.info() == Eigen::Success;
}

Stability stability_of(const Eigenmodes& found) {
  double largest = 0.0, growth = -HUGE_VAL;
  for (const Mode& mode : found.modes) {
    largest = std::max(largest, std::abs(mode.eigenvalue));
    growth = std::max(growth, mode.eigenvalue.real());
  }
  if (growth > zero_real_part * largest) return Stability::unstable;
  return found.zeros == 0 && growth < -zero_real_part * largest ? Stability::asymptotic : Stability::neutral;
}

}  // namespace

void finish(Eigenmodes& found) {
  std::ranges::sort(found.modes, [](const Mode& a, const Mode& b) {
    return std::pair(a.eigenvalue.imag(), a.eigenvalue.real()) <
           std::pair(b.eigenvalue.imag(), b.eigenvalue.real());
  });
  found.stability = stability_of(found);
}

Eigenmodes eigenmodes(const Linearisation& linear) {
  if (linear.state.size() == 0) return {};
  Eigenmodes found =
      linear.conservative && positive_masses(linear.mass) ? of_conservative(linear) : of_state(linear);
  finish(found);
  return found;
}

const char* describe(Stability stability) {
  switch (stability) {
    case Stability::asymptotic:
      return "asymptotically stable: all eigenvalues have negative real parts";
    case Stability::unstable:
      return "unstable: an eigenvalue has a positive real part";
    default:
      return "neutral: no eigenvalue has a positive real part, some have none; higher terms decide";
  }
}

}  // namespace diracstep
