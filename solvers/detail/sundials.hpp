#pragma once

#include <kinsol/kinsol.h>
#include <kinsol/kinsol_ls.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>
#include <sundials/sundials_linearsolver.h>
#include <sundials/sundials_matrix.h>

#include <cstdio>
#include <diracstep/core/numerics/errors.hpp>
#include <memory>
#include <string>

/// The few lines that depend on the version of SUNDIALS, and owning handles for its objects.
namespace diracstep::detail {

/// Throws where a SUNDIALS set-up call fails; every return code is checked in every build type.
inline void require(int code, const char* call) {
  if (code < 0) throw Error(std::string("SUNDIALS: ") + call + " returned " + std::to_string(code));
}

template <class T>
T* require(T* object, const char* call) {
  if (object == nullptr) throw Error(std::string("SUNDIALS: ") + call + " returned no object");
  return object;
}

/// A context; one for each solver, so that solvers on different threads share nothing.
class Context {
 public:
  Context() {
#if SUNDIALS_VERSION_MAJOR >= 7
    require(SUNContext_Create(SUN_COMM_NULL, &context_), "SUNContext_Create");
    SUNContext_ClearErrHandlers(context_);
#else
    require(SUNContext_Create(nullptr, &context_), "SUNContext_Create");
#endif
  }
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;
  ~Context() { SUNContext_Free(&context_); }
  operator SUNContext() const { return context_; }  // NOLINT(google-explicit-constructor)

 private:
  SUNContext context_ = nullptr;
};

#if SUNDIALS_VERSION_MAJOR < 7
/// Where KINSOL and IDA 6 write their messages: nowhere.  A file of its own keeps them from flushing the
/// program's streams.
class MessageSink {
 public:
  MessageSink() : file_(std::fopen("/dev/null", "w")) {}
  void attach(void* memory, int (*set_error_file)(void*, std::FILE*) = KINSetErrFile) const {
    if (file_) require(set_error_file(memory, file_.get()), "SetErrFile");
  }

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  std::unique_ptr<std::FILE, Close> file_;
};
#else
struct MessageSink {
  void attach(void*) const {}
};
#endif

struct DestroyVector {
  void operator()(N_Vector v) const { N_VDestroy(v); }
};
using VectorHandle = std::unique_ptr<_generic_N_Vector, DestroyVector>;

struct DestroyMatrix {
  void operator()(SUNMatrix m) const { SUNMatDestroy(m); }
};
using MatrixHandle = std::unique_ptr<_generic_SUNMatrix, DestroyMatrix>;

struct FreeLinearSolver {
  void operator()(SUNLinearSolver s) const { SUNLinSolFree(s); }
};
using LinearSolverHandle = std::unique_ptr<_generic_SUNLinearSolver, FreeLinearSolver>;

struct FreeKinsol {
  void operator()(void* memory) const { KINFree(&memory); }
};
using KinsolHandle = std::unique_ptr<void, FreeKinsol>;

}  // namespace diracstep::detail
