/* Loaded before a program (LD_PRELOAD): makes one call of the system or of the allocator fail.
 *   DIRACSTEP_FAULT_KIND    io: open, write, fsync, …; memory: malloc, calloc, realloc, aligned_alloc, …
 *   DIRACSTEP_FAULT_CALL    number of the call that fails, from 1; 0 or absent: none
 *   DIRACSTEP_FAULT_LASTING set: every later call fails as well
 *   DIRACSTEP_FAULT_COUNTS  file that takes, at the end, the number of each call that came from a new
 *                           place: one whose chain of callers has not been seen before */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <unwind.h>

enum { frames = 12, most_places = 1 << 16 };

void *__libc_malloc(size_t), *__libc_calloc(size_t, size_t), *__libc_realloc(void *, size_t),
    *__libc_memalign(size_t, size_t);

static long wanted, calls;
static int memory, lasting, ready, inside;
static const char *counts;
static uint64_t seen[most_places];
static long firsts[most_places];
static long places;

static void get_ready(void) {
  const char *kind = getenv("DIRACSTEP_FAULT_KIND"), *call = getenv("DIRACSTEP_FAULT_CALL");
  if (kind == NULL) return;
  memory = strcmp(kind, "memory") == 0;
  wanted = call == NULL ? 0 : atol(call);
  lasting = getenv("DIRACSTEP_FAULT_LASTING") != NULL;
  counts = getenv("DIRACSTEP_FAULT_COUNTS");
  unsetenv("LD_PRELOAD"); /* a compiler that is started works */
  ready = 1;
}

/* Calls count while main() runs: before, there is nobody who could tell of a failure. */
typedef int main_function(int, char **, char **);
static main_function *real_main;

static int counted_main(int count, char **arguments, char **environment) {
  get_ready();
  const int status = real_main(count, arguments, environment);
  ready = 0;
  return status;
}

int __libc_start_main(main_function *main, int count, char **arguments, void (*first)(void),
                      void (*last)(void), void (*loader_last)(void), void *stack) {
  real_main = main;
  return (
      (int (*)(main_function *, int, char **, void (*)(void), void (*)(void), void (*)(void), void *))dlsym(
          RTLD_NEXT, "__libc_start_main"))(counted_main, count, arguments, first, last, loader_last, stack);
}

struct walk {
  uint64_t hash;
  int depth;
};

static _Unwind_Reason_Code step(struct _Unwind_Context *context, void *data) {
  struct walk *walk = data;
  walk->hash = (walk->hash ^ (uint64_t)_Unwind_GetIP(context)) * 1099511628211u;
  return ++walk->depth < frames ? _URC_NO_REASON : _URC_END_OF_STACK;
}

static void note_place(void) {
  struct walk walk = {14695981039346656037u, 0};
  _Unwind_Backtrace(step, &walk);
  size_t at = (size_t)(walk.hash % most_places);
  while (seen[at] != 0 && seen[at] != walk.hash) at = (at + 1) % most_places;
  if (seen[at] == walk.hash || places >= most_places / 2) return;
  seen[at] = walk.hash;
  firsts[places++] = calls;
}

/* Functions of SUNDIALS 6.4 that follow a null pointer where memory is short: nobody could tell of that. */
static const char *const crashing[] = {
    "N_VClone",     "SUNContext_Create",        "ARKodeButcherTable_LoadERK",
    "erkStep_Init", "ERKStepGetReturnFlagName", "IDAGetReturnFlagName"};

static _Unwind_Reason_Code find_crashing(struct _Unwind_Context *context, void *found) {
  Dl_info place;
  if (dladdr((void *)_Unwind_GetIP(context), &place) == 0 || place.dli_sname == NULL) return _URC_NO_REASON;
  for (size_t i = 0; i < sizeof crashing / sizeof *crashing; ++i)
    if (strcmp(place.dli_sname, crashing[i]) == 0) *(int *)found = 1;
  return _URC_NO_REASON;
}
static int within_crashing(void) {
  int found = 0;
  inside = 1;
  _Unwind_Backtrace(find_crashing, &found);
  inside = 0;
  return found;
}

static int fails(int of_memory) {
  if (!ready || inside || of_memory != memory) return 0;
  inside = 1;
  ++calls;
  if (counts != NULL) note_place();
  inside = 0;
  if (wanted == 0 || (lasting ? calls < wanted : calls != wanted)) return 0;
  return !(of_memory && within_crashing());
}

__attribute__((destructor)) static void end(void) {
  if (counts == NULL) return;
  inside = 1;
  FILE *file = fopen(counts, "w");
  for (long i = 0; file != NULL && i < places; ++i) fprintf(file, "%ld\n", firsts[i]);
  if (file != NULL) fclose(file);
}

#define NEXT(name) ((__typeof__(name) *)dlsym(RTLD_NEXT, #name))
#define FAIL_IF(error, result) \
  if (fails(0)) {              \
    errno = (error);           \
    return result;             \
  }

int open(const char *path, int flags, ...) {
  va_list list;
  va_start(list, flags);
  const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(list, mode_t) : 0;
  va_end(list);
  FAIL_IF(EMFILE, -1)
  return ((int (*)(const char *, int, mode_t))dlsym(RTLD_NEXT, "open"))(path, flags, mode);
}
ssize_t write(int file, const void *bytes, size_t size) {
  if (fails(0)) {
    /* half of it is written, as on a disk that becomes full */
    if (size > 1) (void)!NEXT(write)(file, bytes, size / 2);
    errno = ENOSPC;
    return -1;
  }
  return NEXT(write)(file, bytes, size);
}
ssize_t read(int file, void *bytes, size_t size) {
  FAIL_IF(EIO, -1)
  return NEXT(read)(file, bytes, size);
}
ssize_t pread(int file, void *bytes, size_t size, off_t at) {
  FAIL_IF(EIO, -1)
  return NEXT(pread)(file, bytes, size, at);
}
int fsync(int file) {
  FAIL_IF(EIO, -1)
  return NEXT(fsync)(file);
}
int ftruncate(int file, off_t size) {
  FAIL_IF(EIO, -1)
  return NEXT(ftruncate)(file, size);
}
int rename(const char *from, const char *to) {
  FAIL_IF(EIO, -1)
  return NEXT(rename)(from, to);
}
int unlink(const char *path) {
  FAIL_IF(EIO, -1)
  return NEXT(unlink)(path);
}
int close(int file) {
  if (fails(0)) {
    (void)NEXT(close)(file); /* Linux closes it even then */
    errno = EIO;
    return -1;
  }
  return NEXT(close)(file);
}
int fstat(int file, struct stat *status) {
  FAIL_IF(EIO, -1)
  return NEXT(fstat)(file, status);
}
int stat(const char *path, struct stat *status) {
  FAIL_IF(EIO, -1)
  return NEXT(stat)(path, status);
}
int flock(int file, int how) {
  FAIL_IF(ENOLCK, -1)
  return NEXT(flock)(file, how);
}
off_t lseek(int file, off_t at, int from) {
  FAIL_IF(EIO, -1)
  return NEXT(lseek)(file, at, from);
}
size_t fwrite(const void *bytes, size_t size, size_t count, FILE *file) {
  FAIL_IF(ENOSPC, 0)
  return NEXT(fwrite)(bytes, size, count, file);
}
int fflush(FILE *file) {
  FAIL_IF(ENOSPC, EOF)
  return NEXT(fflush)(file);
}

#define NEXT_ALLOCATION(name)                         \
  ({                                                  \
    static __typeof__(name) *next;                    \
    if (next == NULL) next = dlsym(RTLD_NEXT, #name); \
    next;                                             \
  })
#define NO_MEMORY_IF_WANTED \
  if (fails(1)) {           \
    errno = ENOMEM;         \
    return NULL;            \
  }

/* The command has a malloc of its own, which counts and then calls these (count_allocations.hpp). */
void *__libc_malloc(size_t size) {
  NO_MEMORY_IF_WANTED
  return NEXT_ALLOCATION(__libc_malloc)(size);
}
void *__libc_calloc(size_t count, size_t size) {
  NO_MEMORY_IF_WANTED
  return NEXT_ALLOCATION(__libc_calloc)(count, size);
}
void *__libc_realloc(void *old, size_t size) {
  NO_MEMORY_IF_WANTED
  return NEXT_ALLOCATION(__libc_realloc)(old, size);
}
void *__libc_memalign(size_t alignment, size_t size) {
  NO_MEMORY_IF_WANTED
  return NEXT_ALLOCATION(__libc_memalign)(alignment, size);
}
