#include <diracstep/core/numerics/errors.hpp>
#include <diracstep/eigenvalues/largest_eigenpairs.hpp>
#ifdef DIRACSTEP_WITH_SPECTRA
#if defined(__GNUC__) && !defined(__clang__) && __GNUC__ >= 12  // sees a column freed twice that is not
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wuse-after-free"
#include <Spectra/GenEigsSolver.h>
#pragma GCC diagnostic pop
#else
#include <Spectra/GenEigsSolver.h>
#endif

#include <algorithm>
#endif

namespace diracstep {

#ifdef DIRACSTEP_WITH_SPECTRA

namespace {

/// A map as Spectra asks for it.
struct MapOfSpectra {
  using Scalar = double;

  Eigen::Index rows() const { return size; }
  Eigen::Index cols() const { return size; }
  void perform_op(const double* in, double* out) const {
    map(Eigen::Map<const Vector>(in, size), Eigen::Map<Vector>(out, size));
  }

  const LinearMap& map;
  Eigen::Index size;
};

}  // namespace

Eigenpairs largest_eigenpairs(const LinearMap& map, const Vector& start, Eigen::Index count) {
  constexpr Eigen::Index fewest_columns = 24, most_restarts = 1000;
  constexpr double tolerance = 1e-12;
  const Eigen::Index size = start.size();
  const Eigen::Index columns = std::min(size, std::max(fewest_columns, 2 * count + 2));
  MapOfSpectra spectra_map{map, size};
  Spectra::GenEigsSolver<MapOfSpectra> solver(spectra_map, count, columns);
  solver.init(start.data());
  const Eigen::Index found = solver.compute(Spectra::SortRule::LargestMagn, most_restarts, tolerance);
  Eigenpairs pairs{solver.eigenvalues(), solver.eigenvectors()};
  if (solver.info() != Spectra::CompInfo::Successful)
    pairs.failure = std::to_string(found) + " of " + std::to_string(count) + " eigenvalues were found in " +
                    std::to_string(most_restarts) + " restarts";
  return pairs;
}

#else

Eigenpairs largest_eigenpairs(const LinearMap&, const Vector&, Eigen::Index) {
  throw Misuse("sparse eigenvalues need the library Spectra, which this build was made without");
}

#endif

}  // namespace diracstep
