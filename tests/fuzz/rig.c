/* SPDX-License-Identifier: MIT */
#include "tests/fuzz/rig.h"

#include <dirent.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

enum { ENDINGS = 8 };

static char folder[512];
static pid_t owner;
static struct memory_file {
    char ending[16], path[600];
    int fd;
} file[ENDINGS];

/* Removes only the files in the folder itself, because targets make no folders. */
static void remove_folder(void)
{
    DIR *dir = getpid() == owner ? opendir(folder) : NULL;
    if (dir == NULL) return;
    for (struct dirent *e; (e = readdir(dir)) != NULL;)
        if (e->d_name[0] != '.') unlinkat(dirfd(dir), e->d_name, 0);
    closedir(dir);
    rmdir(folder);
}

const char *fuzz_folder(void)
{
    if (folder[0] != '\0') return folder;
    const char *above = getenv("TMPDIR");
    snprintf(folder, sizeof folder, "%s/scanhead-fuzz-XXXXXX", above != NULL && above[0] != '\0' ? above : "/tmp");
    if (mkdtemp(folder) == NULL) {
        perror(folder);
        exit(1);
    }
    owner = getpid();
    atexit(remove_folder);
    return folder;
}

/* Makes a link in the folder to a descriptor of this process, so that a child that reads the file finds it, too. */
static void open_memory(struct memory_file *f, const char *ending)
{
    char target[64];
    snprintf(f->ending, sizeof f->ending, "%s", ending);
    snprintf(f->path, sizeof f->path, "%s/in%s", fuzz_folder(), ending);
    f->fd = memfd_create("fuzz", 0);
    snprintf(target, sizeof target, "/proc/%d/fd/%d", (int)getpid(), f->fd);
    if (f->fd < 0 || symlink(target, f->path) != 0) {
        perror(f->path);
        exit(1);
    }
}

static void write_all(int fd, const char *path, const uint8_t *data, size_t size)
{
    if (ftruncate(fd, 0) == 0 && pwrite(fd, data, size, 0) == (ssize_t)size) return;
    perror(path);
    exit(1);
}

const char *fuzz_file(const char *ending, const uint8_t *data, size_t size)
{
    struct memory_file *f = file;
    while (f->path[0] != '\0' && strcmp(f->ending, ending) != 0)
        f++;
    fuzz_must(f < file + ENDINGS, "more endings than the rig has room for");
    if (f->path[0] == '\0') open_memory(f, ending);
    write_all(f->fd, f->path, data, size);
    return f->path;
}

const char *fuzz_disk_file(const char *name, const uint8_t *data, size_t size)
{
    static char path[4][600];
    static unsigned turn;
    char *at = path[turn++ % 4];
    snprintf(at, sizeof path[0], "%s/%s", fuzz_folder(), name);
    const int fd = open(at, O_CREAT | O_WRONLY | O_CLOEXEC, 0600);
    if (fd < 0) {
        perror(at);
        exit(1);
    }
    write_all(fd, at, data, size);
    close(fd);
    return at;
}

unsigned fuzz_u8(struct fuzz_bytes *from)
{
    if (from->n == 0) return 0;
    from->n--;
    return *from->p++;
}

unsigned fuzz_u16(struct fuzz_bytes *from)
{
    const unsigned low = fuzz_u8(from);
    return low | fuzz_u8(from) << 8;
}

uint32_t fuzz_u32(struct fuzz_bytes *from)
{
    const uint32_t low = fuzz_u16(from);
    return low | (uint32_t)fuzz_u16(from) << 16;
}

const uint8_t *fuzz_take(struct fuzz_bytes *from, size_t n, size_t *got)
{
    const uint8_t *p = from->p;
    *got = n < from->n ? n : from->n;
    from->p += *got;
    from->n -= *got;
    return p;
}

void fuzz_must(int ok, const char *words)
{
    if (ok) return;
    fprintf(stderr, "the target's claim does not hold: %s\n", words);
    abort();
}

static void must_be_line(const char *text)
{
    fuzz_must(text[0] != '\0', "a message has words");
    for (const char *c = text; *c != '\0'; c++) {
        if ((unsigned char)*c >= ' ' && *c != 0x7f) continue;
        fprintf(stderr, "message: %s\n", text);
        fuzz_must(0, "a message is one line of printable text");
    }
}

void fuzz_must_be_line(const struct sh_err *err)
{
    fuzz_must(err->code != SH_OK, "an error has its code");
    must_be_line(err->text);
}

static void warn(void *ctx, const char *text)
{
    (void)ctx;
    must_be_line(text);
}

const struct sh_report fuzz_report = {.warn = warn};

/* Nobody needs these files on the disk, and waiting for that takes most of the time. */
int fsync(int fd);
int fsync(int fd)
{
    (void)fd;
    return 0;
}
int fdatasync(int fd);
int fdatasync(int fd)
{
    (void)fd;
    return 0;
}
