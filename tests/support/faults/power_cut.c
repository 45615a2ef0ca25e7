/* Loaded before a program (LD_PRELOAD): the power fails before one of its calls that change files, and what a
 * disk may hold then is put together in a folder.  A disk holds what was synchronised, and of the rest as
 * little as it likes: bytes are lost that no fsync() of their file followed; names made by open() or changed
 * by rename() and unlink() may be lost until their folder is synchronised, or may have come to the disk
 * before the bytes did. DIRACSTEP_POWER_FOLDER  the folder that is watched: files right in it
 *   DIRACSTEP_POWER_AFTER   takes the files as the disk holds them
 *   DIRACSTEP_POWER_CALL    number of the call, from 1, before which the power fails
 *   DIRACSTEP_POWER_NAMES   "old": names as last synchronised; "new": names as they are */
#define _GNU_SOURCE
#include <dirent.h>
#include <dlfcn.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { most_files = 4096, most_names = 64 };

static char folder[PATH_MAX], after[PATH_MAX];
static long wanted, calls;
static int new_names, inside;

/* The bytes of each inode as last synchronised. */
static struct {
  ino_t inode;
  char *bytes;
  long size;
} disk[most_files];
static int inodes;

/* The names of the folder as last synchronised. */
static struct {
  char name[256];
  ino_t inode;
} names[most_names];
static int name_count;

#define NEXT(name) ((__typeof__(name) *)dlsym(RTLD_NEXT, #name))

static void read_names(void) {
  DIR *directory = opendir(folder);
  name_count = 0;
  if (directory == NULL) return;
  for (struct dirent *entry; (entry = readdir(directory)) != NULL && name_count < most_names;) {
    if (entry->d_name[0] == '.') continue;
    snprintf(names[name_count].name, sizeof names[0].name, "%s", entry->d_name);
    names[name_count++].inode = entry->d_ino;
  }
  closedir(directory);
}

static int slot(ino_t inode) {
  for (int i = 0; i < inodes; ++i)
    if (disk[i].inode == inode) return i;
  if (inodes == most_files) abort();
  disk[inodes].inode = inode;
  disk[inodes].bytes = NULL;
  disk[inodes].size = 0;
  return inodes++;
}

static void synchronise(int file) {
  struct stat status;
  char path[64];
  if (fstat(file, &status) != 0) return;
  if (S_ISDIR(status.st_mode)) {
    read_names();
    return;
  }
  const int at = slot(status.st_ino);
  free(disk[at].bytes);
  disk[at].bytes = malloc((size_t)status.st_size + 1);
  disk[at].size = 0;
  snprintf(path, sizeof path, "/proc/self/fd/%d", file); /* it may be open for writing only */
  const int copy = NEXT(open)(path, O_RDONLY);
  if (copy >= 0 && disk[at].bytes != NULL)
    disk[at].size = pread(copy, disk[at].bytes, (size_t)status.st_size, 0);
  if (copy >= 0) NEXT(close)(copy);
}

static void fail(void) {
  char path[2 * PATH_MAX];
  if (new_names) read_names();
  for (int i = 0; i < name_count; ++i) {
    const int at = slot(names[i].inode);
    snprintf(path, sizeof path, "%s/%.255s", after, names[i].name);
    const int file = NEXT(open)(path, O_WRONLY | O_CREAT | O_TRUNC, 0644);
    if (file < 0 ||
        (disk[at].size > 0 && NEXT(write)(file, disk[at].bytes, (size_t)disk[at].size) != disk[at].size))
      abort();
    NEXT(close)(file);
  }
  _exit(137);
}

static void before_call(void) {
  if (folder[0] == 0 || inside) return;
  if (++calls == wanted) {
    inside = 1;
    fail();
  }
}

/* Files that are there at the beginning are on the disk. */
__attribute__((constructor)) static void begin(void) {
  const char *watched = getenv("DIRACSTEP_POWER_FOLDER"), *result = getenv("DIRACSTEP_POWER_AFTER");
  if (watched == NULL || result == NULL) return;
  snprintf(folder, sizeof folder, "%s", watched);
  snprintf(after, sizeof after, "%s", result);
  const char *call = getenv("DIRACSTEP_POWER_CALL"), *which = getenv("DIRACSTEP_POWER_NAMES");
  wanted = call == NULL ? 0 : atol(call);
  new_names = which != NULL && strcmp(which, "new") == 0;
  inside = 1;
  read_names();
  for (int i = 0; i < name_count; ++i) {
    char path[2 * PATH_MAX];
    snprintf(path, sizeof path, "%s/%.255s", folder, names[i].name);
    const int file = NEXT(open)(path, O_RDONLY);
    if (file >= 0) synchronise(file);
    if (file >= 0) NEXT(close)(file);
  }
  inside = 0;
}

/* A new file has nothing on the disk, even where its inode is that of a removed one. */
int open(const char *path, int flags, ...) {
  va_list list;
  va_start(list, flags);
  const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(list, mode_t) : 0;
  va_end(list);
  const int file = ((int (*)(const char *, int, mode_t))dlsym(RTLD_NEXT, "open"))(path, flags, mode);
  struct stat status;
  if (folder[0] != 0 && !inside && file >= 0 && (flags & O_EXCL) != 0 && fstat(file, &status) == 0)
    disk[slot(status.st_ino)].size = 0;
  return file;
}
ssize_t write(int file, const void *bytes, size_t size) {
  before_call();
  return NEXT(write)(file, bytes, size);
}
int ftruncate(int file, off_t size) {
  before_call();
  return NEXT(ftruncate)(file, size);
}
int rename(const char *from, const char *to) {
  before_call();
  return NEXT(rename)(from, to);
}
int fsync(int file) {
  before_call();
  const int result = NEXT(fsync)(file);
  if (folder[0] != 0 && !inside && result == 0) {
    inside = 1;
    synchronise(file);
    inside = 0;
  }
  return result;
}
