#pragma once

#include <atomic>
#include <diracstep/core/numerics/sparsity_pattern.hpp>
#include <diracstep/core/numerics/types.hpp>
#include <functional>
#include <string>
#include <vector>

/// Derivatives by central differences of sixth order,  f' ≈ [45 Δ₁ − 9 Δ₂ + Δ₃] / (60 δ)  with
/// Δ_k = f(x + kδ) − f(x − kδ) and δ about 2e-3 of the scale of the variable.  Exact up to round-off for
/// polynomials of degree 6; the round-off is about 1e-13 of the terms of f.
///
/// Each is checked against the difference of fourth order from the same values, [8 Δ₁ − Δ₂] / (12 δ); where
/// the two differ by more than 1e-7 and by more than round-off, δ is divided by 16 and both are taken again.
namespace diracstep {

/// What the differences of a scene's functions were worth so far; may be used from several threads at once.
class DifferenceQuality {
 public:
  /// A derivative of an energy, times the scale of its variable, and what may be wrong with it.
  void note_energy(double derivative, double error);
  /// Energies at play: what errors of energies are measured by is the largest of these and of the
  /// derivatives.
  void note_size(double energy);
  double largest_energy() const { return largest_.load(); }
  /// Part of a derivative by which two formulas still disagree with the smallest δ.
  void note_disagreement(double part);

  /// Empty, or that the derivatives are not to be trusted, and to how many digits they are known.
  std::string doubt() const;

 private:
  std::atomic<double> largest_ = 0.0, error_ = 0.0, disagreement_ = 0.0;
};

/// How far each variable goes before f changes much: a number above 0 for each, in its own unit.
using DifferenceScales = Vector;

/// Scales at a point, from guesses that may be off by far: of those at which f is resolved, so that both
/// formulas agree for its odd part and two formulas for its even part, the one with the smallest error of
/// ∂f/∂x_i.  Where f is resolved by none, or does not change with x_i, the guess stays.
DifferenceScales find_scales(const std::function<double(ConstVectorRef)>& f, ConstVectorRef x,
                             const Vector& guesses);

/// g_i = ∂f/∂x_i of a scalar function.  Without scales each is max(1, |x_i|).  `noise` receives what each g_i
/// may lose by the round-off of f, whose terms may cancel at x: differences of g are judged by that.
void gradient_by_differences(const std::function<double(ConstVectorRef)>& f, ConstVectorRef x, VectorRef g,
                             const DifferenceScales& scales = {}, DifferenceQuality* quality = nullptr,
                             Vector* noise = nullptr);

/// df/dt of a column f(t, out).  Of a row that is itself known to `noise` only, a smaller difference is 0.
void rate_by_differences(const std::function<void(double, VectorRef)>& f, double t, VectorRef rate,
                         double scale = 1.0, const Vector& noise = {});

/// ∂f/∂x of columns on a known pattern.  Columns of the pattern that share no row are differenced together
/// (Curtis, Powell, Reid 1974), so a sparse derivative takes few evaluations.
class JacobianByDifferences {
 public:
  explicit JacobianByDifferences(SparsityPattern pattern);

  const SparsityPattern& pattern() const { return pattern_; }
  std::size_t groups() const { return groups_.size(); }

  /// values = ∂f/∂x on pattern(); `f(x, out)` writes pattern().rows() numbers, known to `noise` where that is
  /// more than their round-off: a smaller difference of them is 0.
  void evaluate(const std::function<void(ConstVectorRef, VectorRef)>& f, ConstVectorRef x, VectorRef values,
                const DifferenceScales& scales = {}, DifferenceQuality* quality = nullptr,
                const Vector& noise = {}) const;

 private:
  SparsityPattern pattern_;
  std::vector<std::vector<int>> groups_;
};

}  // namespace diracstep
