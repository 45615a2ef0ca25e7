#include <Eigen/Eigenvalues>
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <diracstep/core/equilibrium/eigenmodes.hpp>
#include <limits>
#include <vector>

namespace diracstep {

namespace {

constexpr double zero_eigenvalue = 1e-12;  // of the largest, beside round-off of the matrix
constexpr double slow = 1e-8;              // of the largest square of a rate: to be looked at for itself

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
  double left = 0.0;  ///< the largest pivot that counted as 0
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
    Split split{all.rightCols(n - rank), all.leftCols(rank), {}, pivots.tail(n - rank).maxCoeff()};
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

/// The columns as combinations that each have an entry 1, their largest, where the others have 0.
Columns told_apart(Columns columns) {
  constexpr double nothing = 1e-10;
  for (Eigen::Index k = 0; k < columns.cols(); ++k) {
    Eigen::Index row = 0, column = 0;
    if (columns.rightCols(columns.cols() - k).cwiseAbs().maxCoeff(&row, &column) == 0.0) break;
    columns.col(k).swap(columns.col(k + column));
    columns.col(k) /= columns(row, k);
    for (Eigen::Index other = 0; other < columns.cols(); ++other)
      if (other != k) columns.col(other) -= columns(row, other) * Vector(columns.col(k));
  }
  for (auto column : columns.colwise()) {
    const double largest = column.lpNorm<Eigen::Infinity>();
    column = (column.cwiseAbs().array() <= nothing * largest).select(0.0, column);
  }
  return columns;
}

/// What round-off of the matrix may make of its eigenvalues: by the angles between their left and right
/// eigenvectors (Wilkinson, The Algebraic Eigenvalue Problem, 1965, chapter 2); of defective ones no more
/// than where three join.
Vector round_off_of_eigenvalues(const Columns& a, const Eigen::MatrixXcd& vectors) {
  constexpr double epsilon = 4.0 * std::numeric_limits<double>::epsilon();
  const double most = std::cbrt(epsilon), size = a.norm();
  const Eigen::MatrixXcd left = vectors.partialPivLu().inverse();
  Vector errors(a.cols());
  for (Eigen::Index k = 0; k < a.cols(); ++k) {
    const double error = epsilon * left.row(k).norm() * vectors.col(k).norm();
    errors[k] = size * (error <= most ? error : most);
  }
  return errors;
}

Eigenmodes of_state(const Linearisation& linear) {
  Columns a = linear.state;
  const Vector scale = balancing(a);
  const double size = a.norm();
  const std::vector<Split> splits = split_zeros(a);
  const Eigen::Index y = linear.positions.cols();
  Eigenmodes found;
  found.zeros = static_cast<int>(linear.state.cols() - a.cols());
  for (const Split& split : splits)
    found.zeros_below = std::max(found.zeros_below, std::sqrt(split.left * size));
  if (!splits.empty())
    found.free_directions =
        told_apart(linear.positions * (scale.asDiagonal() * splits.front().kernel).topRows(y));
  if (a.cols() == 0) return found;
  const Eigen::EigenSolver<Columns> solved(a);
  const Vector round_off = round_off_of_eigenvalues(a, solved.eigenvectors());
  for (Eigen::Index k = 0; k < a.cols(); ++k) {
    Complex eigenvalue = solved.eigenvalues()[k];
    if (eigenvalue.imag() < 0.0) continue;
    if (eigenvalue.imag() > 0.0 && std::abs(eigenvalue.real()) <= round_off[k])
      eigenvalue = {0.0, eigenvalue.imag()};
    const ComplexVector state = scale.asDiagonal() * joined(splits, solved.eigenvectors().col(k), eigenvalue);
    found.modes.push_back({eigenvalue, with_largest_one(linear.positions * state.head(y)), round_off[k]});
  }
  return found;
}

/// Solutions of K y = ω² M y with yᵀ M y = 1, and what round-off in K may make of ω².
struct Vibrations {
  Vector squares, round_off;
  Columns shapes;
};

Vibrations vibrations(const Columns& stiffness, const Columns& round_off, const Columns& mass) {
  const Eigen::GeneralizedSelfAdjointEigenSolver<Columns> solved(stiffness, mass);
  Vibrations all{solved.eigenvalues(), {}, solved.eigenvectors()};
  const auto reduced_by = [](const Columns& matrix, const Columns& shapes) {
    return Columns(shapes.transpose() * matrix * shapes);
  };
  all.round_off = reduced_by(round_off, all.shapes.cwiseAbs()).diagonal();
  const double largest = all.squares.lpNorm<Eigen::Infinity>();
  std::vector<Eigen::Index> slow_ones;
  for (Eigen::Index k = 0; k < all.squares.size(); ++k)
    if (std::abs(all.squares[k]) <= slow * largest) slow_ones.push_back(k);
  if (slow_ones.empty() || largest == 0.0) return all;
  const Columns among = all.shapes(Eigen::all, slow_ones);
  const Columns their_round_off = reduced_by(round_off, among.cwiseAbs());
  const Columns theirs = reduced_by(stiffness, among);
  const Columns told = (theirs.cwiseAbs().array() <= their_round_off.array()).select(0.0, theirs);
  const Vibrations again = vibrations(told, their_round_off, reduced_by(mass, among));
  all.squares(slow_ones) = again.squares;
  all.round_off(slow_ones) = again.round_off;
  all.shapes(Eigen::all, slow_ones) = among * again.shapes;
  return all;
}

Eigenmodes of_conservative(const Linearisation& linear) {
  const Vibrations found_ones = vibrations(linear.stiffness, linear.stiffness_round_off, linear.mass);
  const Vector& squares = found_ones.squares;
  Eigenmodes found;
  std::vector<Eigen::Index> free;
  for (Eigen::Index k = 0; k < squares.size(); ++k) {
    if (std::abs(squares[k]) <= found_ones.round_off[k]) {
      free.push_back(k);
      found.zeros += 2;
      found.zeros_below = std::max(found.zeros_below, std::sqrt(found_ones.round_off[k]));
      continue;
    }
    const double rate = std::sqrt(std::abs(squares[k]));
    const ComplexVector shape =
        with_largest_one((linear.positions * found_ones.shapes.col(k)).cast<Complex>());
    if (squares[k] > 0.0) {
      found.modes.push_back({{0.0, rate}, shape});
    } else {
      found.modes.push_back({{rate, 0.0}, shape});
      found.modes.push_back({{-rate, 0.0}, shape});
    }
  }
  found.free_directions = told_apart(linear.positions * found_ones.shapes(Eigen::all, free));
  return found;
}

bool positive_masses(const Columns& mass) {
  const Eigen::LLT<Columns> factors(mass);
  return factors.info() == Eigen::Success;
}

Stability stability_of(const Eigenmodes& found) {
  bool decays = found.zeros == 0, decided = true;
  for (const Mode& mode : found.modes) {
    const double growth = mode.eigenvalue.real();
    if (growth > mode.round_off) return Stability::unstable;
    decays = decays && growth < -mode.round_off;
    decided = decided && (mode.eigenvalue.imag() > 0.0 || growth < -mode.round_off);
  }
  if (!decided) return Stability::undecided;
  return decays ? Stability::asymptotic : Stability::neutral;
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
    case Stability::undecided:
      return "undecided: a real eigenvalue is as small as its round-off, whose sign is not known";
    default:
      return "neutral: no eigenvalue has a positive real part, some have none; higher terms decide";
  }
}

}  // namespace diracstep
