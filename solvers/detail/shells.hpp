#pragma once

#include <diracstep/solvers/detail/sundials.hpp>
#include <exception>
#include <utility>

/// What lets SUNDIALS call code of ours.
namespace diracstep::detail {

/// A matrix that SUNDIALS carries around and never looks into: the values of the Jacobian stand elsewhere.
inline MatrixHandle make_matrix_shell(SUNContext context) {
  MatrixHandle shell(require(SUNMatNewEmpty(context), "SUNMatNewEmpty"));
  shell->ops->getid = [](SUNMatrix) { return SUNMATRIX_CUSTOM; };
  shell->ops->zero = [](SUNMatrix) { return 0; };
  shell->ops->destroy = [](SUNMatrix m) { SUNMatFreeEmpty(m); };
  return shell;
}

/// A direct linear solver of ours; the caller sets ops->setup and ops->solve, which find `content`.
inline LinearSolverHandle make_linear_solver_shell(SUNContext context, void* content) {
  LinearSolverHandle shell(require(SUNLinSolNewEmpty(context), "SUNLinSolNewEmpty"));
  shell->content = content;
  shell->ops->gettype = [](SUNLinearSolver) { return SUNLINEARSOLVER_DIRECT; };
  shell->ops->getid = [](SUNLinearSolver) { return SUNLINEARSOLVER_CUSTOM; };
  shell->ops->initialize = [](SUNLinearSolver) { return 0; };
  shell->ops->free = [](SUNLinearSolver s) {
    SUNLinSolFreeEmpty(s);
    return 0;
  };
  return shell;
}

/// Keeps an exception of a callback, which must not cross SUNDIALS, until the call has returned.
class ExceptionKeeper {
 public:
  /// The body's return code; that of an unrecoverable error where it throws.
  template <class Body>
  int guarded(Body body) noexcept {
    try {
      return body();
    } catch (...) {
      exception_ = std::current_exception();
      return -1;
    }
  }
  void rethrow() {
    if (exception_) std::rethrow_exception(std::exchange(exception_, nullptr));
  }

 private:
  std::exception_ptr exception_;
};

}  // namespace diracstep::detail
