/* A disk that fails on demand, and one that notes everything written to it.
 *
 * Preloaded into a process, it counts the calls that change files under one folder. The N-th of them, or every
 * one from the N-th on, fails with a given error, or writes half of what it was given. Optionally every call
 * is written to a log, from which the state of the disk after a power cut can be made up.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static char folder[PATH_MAX];
static int nth, error_number, always, calls, log_handle = -1;

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

/* error 0: short write; n 0: never fail */
void fault_arm(const char *prefix, int n, int error, int every)
{
    strncpy(folder, prefix, sizeof folder - 1);
    nth = n; error_number = error; always = every; calls = 0;
}

int fault_disarm(void) { folder[0] = 0; return calls; }

void fault_log(const char *path)
{
    if (log_handle >= 0) close(log_handle);
    log_handle = path ? REAL(open)(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600) : -1;
}

static int watched_path(const char *path) { return folder[0] && path && !strncmp(path, folder, strlen(folder)); }

static int watched(int handle)
{
    char link[64], target[PATH_MAX];
    if (!folder[0] || handle == log_handle) return 0;
    snprintf(link, sizeof link, "/proc/self/fd/%d", handle);
    ssize_t length = readlink(link, target, sizeof target - 1);
    if (length <= 0) return 0;
    target[length] = 0;
    return watched_path(target);
}

static int fails(void)
{
    calls++;
    return nth && (calls == nth || (always && calls > nth));
}

static uint64_t inode(int handle)
{
    struct stat status;
    return fstat(handle, &status) ? 0 : status.st_ino;
}

static void note(char kind, uint64_t a, uint64_t b, const void *data, uint32_t length)
{
    struct { char kind; uint64_t a, b; uint32_t length; } __attribute__((packed)) head = {kind, a, b, length};
    if (log_handle < 0) return;
    if (REAL(write)(log_handle, &head, sizeof head) != (ssize_t)sizeof head) _exit(99);
    if (length && REAL(write)(log_handle, data, length) != (ssize_t)length) _exit(99);
}

static void note_names(char kind, uint64_t a, const char *one, const char *two)
{
    char both[2 * PATH_MAX];
    int length = snprintf(both, sizeof both, "%s%c%s", one, 0, two);
    note(kind, a, 0, both, (uint32_t)length);
}

#define WRITE(NAME, TYPE)                                                                   \
    ssize_t NAME(int handle, const void *data, size_t length, TYPE offset)                  \
    {                                                                                       \
        if (watched(handle)) {                                                              \
            if (fails()) {                                                                  \
                if (error_number) { errno = error_number; return -1; }                      \
                if (length > 1) length /= 2;                                                \
            }                                                                               \
            note('w', inode(handle), (uint64_t)offset, data, (uint32_t)length);             \
        }                                                                                   \
        return REAL(NAME)(handle, data, length, offset);                                    \
    }
WRITE(pwrite, off_t)
WRITE(pwrite64, off64_t)

ssize_t write(int handle, const void *data, size_t length)
{
    if (watched(handle)) {
        if (fails()) {
            if (error_number) { errno = error_number; return -1; }
            if (length > 1) length /= 2;
        }
        note('w', inode(handle), (uint64_t)lseek(handle, 0, SEEK_CUR), data, (uint32_t)length);
    }
    return REAL(write)(handle, data, length);
}

/* Real flushing would only make the tests slow: nothing here survives the machine anyway. */
#define SYNC(NAME)                                                                          \
    int NAME(int handle)                                                                    \
    {                                                                                       \
        if (!watched(handle)) return REAL(NAME)(handle);                                    \
        if (fails() && error_number) { errno = error_number; return -1; }                   \
        note('s', inode(handle), 0, 0, 0);                                                  \
        return 0;                                                                           \
    }
SYNC(fsync)
SYNC(fdatasync)

#define TRUNCATE(NAME, TYPE)                                                                \
    int NAME(int handle, TYPE length)                                                       \
    {                                                                                       \
        if (watched(handle)) {                                                              \
            if (fails() && error_number) { errno = error_number; return -1; }               \
            note('t', inode(handle), (uint64_t)length, 0, 0);                               \
        }                                                                                   \
        return REAL(NAME)(handle, length);                                                  \
    }
TRUNCATE(ftruncate, off_t)
TRUNCATE(ftruncate64, off64_t)

int unlink(const char *path)
{
    if (watched_path(path) && !access(path, F_OK)) {
        if (fails() && error_number) { errno = error_number; return -1; }
        note_names('u', 0, path, "");
    }
    return REAL(unlink)(path);
}

int rename(const char *from, const char *to)
{
    if (watched_path(to)) {
        if (fails() && error_number) { errno = error_number; return -1; }
        note_names('r', 0, from, to);
    }
    return REAL(rename)(from, to);
}

static int opened(int handle, const char *path, int flags, int was_there)
{
    if (handle >= 0 && (flags & O_CREAT) && !was_there && watched_path(path))
        note_names('c', inode(handle), path, "");
    return handle;
}

#define OPEN(NAME)                                                                          \
    int NAME(const char *path, int flags, ...)                                              \
    {                                                                                       \
        va_list more;                                                                       \
        va_start(more, flags);                                                              \
        mode_t mode = (flags & (O_CREAT | __O_TMPFILE)) ? va_arg(more, mode_t) : 0;         \
        va_end(more);                                                                       \
        int was_there = !access(path, F_OK);                                                \
        return opened(REAL(NAME)(path, flags, mode), path, flags, was_there);               \
    }
OPEN(open)
OPEN(open64)

#define OPENAT(NAME)                                                                        \
    int NAME(int at, const char *path, int flags, ...)                                      \
    {                                                                                       \
        va_list more;                                                                       \
        va_start(more, flags);                                                              \
        mode_t mode = (flags & (O_CREAT | __O_TMPFILE)) ? va_arg(more, mode_t) : 0;         \
        va_end(more);                                                                       \
        int was_there = !faccessat(at, path, F_OK, 0);                                      \
        return opened(REAL(NAME)(at, path, flags, mode), path, flags, was_there);           \
    }
OPENAT(openat)
OPENAT(openat64)
