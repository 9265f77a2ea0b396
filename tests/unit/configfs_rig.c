/* SPDX-License-Identifier: MIT */
#include "tests/unit/configfs_rig.h"

#include <dirent.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <ftw.h>
#include <linux/usb/functionfs.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/file.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

struct configfs configfs;
static char root[40];
static int udc_fd = -1; /* of a gadget's UDC */
static int n_open;      /* descriptors of this process before the test */

enum { PATH_ROOM = 600 };

/* Returns where a path really is, in `to` if that is in the folder. */
static const char *moved(const char *path, char to[PATH_ROOM])
{
    if (root[0] == '\0') return path;
    if (strncmp(path, "/sys/kernel/config", 18) != 0 && strncmp(path, CONFIGFS_UDCS, sizeof CONFIGFS_UDCS - 1) != 0 &&
        strcmp(path, "/proc/self/mounts") != 0)
        return path;
    snprintf(to, PATH_ROOM, "%s%s", root, path);
    return to;
}

static int is_attribute(const char *path, const char *name)
{
    const char *last = strrchr(path, '/');
    return name != NULL && last != NULL && strcmp(last + 1, name) == 0;
}

static void *next(const char *name)
{
    return dlsym(RTLD_NEXT, name);
}

void configfs_put(const char *path, const char *text)
{
    char to[PATH_ROOM];
    const int fd = (int)syscall(SYS_openat, AT_FDCWD, moved(path, to), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    assert_true(fd >= 0);
    assert_int_equal(syscall(SYS_write, fd, text, strlen(text)), strlen(text));
    syscall(SYS_close, fd);
}

/* ---- directories */

/* The attributes and groups that come with a directory. Groups end in a slash. */
static const char *parts_of(const char *path)
{
    const char *in = path + sizeof CONFIGFS_GADGETS; /* GADGET/... */
    const char *below = strchr(in, '/');
    if (below == NULL)
        return "idVendor idProduct bcdUSB bcdDevice bDeviceClass bDeviceSubClass bDeviceProtocol max_speed UDC strings/ "
               "configs/ functions/ os_desc/ os_desc/use os_desc/b_vendor_code os_desc/qw_sign";
    if (strncmp(below, "/functions/acm.", 15) == 0) return "protocol port_num";
    if (strncmp(below, "/functions/ffs.", 15) == 0) return "ready";
    if (strcmp(below, "/configs/c.1") == 0) return "bmAttributes MaxPower strings/";
    if (strcmp(below, "/configs/c.1/strings/0x409") == 0) return "configuration";
    if (strcmp(below, "/strings/0x409") == 0) return "manufacturer product serialnumber";
    fail_msg("configfs has no place for %s", path);
    return "";
}

static void add_parts(const char *path)
{
    char list[256], whole[PATH_ROOM], to[PATH_ROOM], *rest = NULL;
    snprintf(list, sizeof list, "%s", parts_of(path));
    for (char *part = strtok_r(list, " ", &rest); part != NULL; part = strtok_r(NULL, " ", &rest)) {
        snprintf(whole, sizeof whole, "%s/%s", path, part);
        if (part[strlen(part) - 1] == '/')
            assert_int_equal(syscall(SYS_mkdirat, AT_FDCWD, moved(whole, to), 0700), 0);
        else if (configfs.no_file == NULL || strcmp(part, configfs.no_file) != 0)
            configfs_put(whole, strcmp(part, "port_num") == 0 ? "3\n" : "");
    }
}

static int other_head = -1; /* the gadget's directory that it has locked */

static void lock_as_other(const char *real)
{
    if (other_head >= 0) close(other_head);
    other_head = configfs.locks_first-- > 0 ? (int)syscall(SYS_openat, AT_FDCWD, real, O_RDONLY | O_DIRECTORY) : -1;
    if (other_head >= 0) assert_int_equal(flock(other_head, LOCK_EX), 0);
}

int mkdir(const char *path, mode_t mode)
{
    char to[PATH_ROOM], kind[16];
    const char *real = moved(path, to);
    if (real == path) return (int)syscall(SYS_mkdirat, AT_FDCWD, path, mode);
    const char *name = path + sizeof CONFIGFS_GADGETS;
    if (strchr(name, '/') == NULL && (configfs.mkdir_error != 0 || configfs.taken > 0)) {
        errno = configfs.mkdir_error != 0 ? configfs.mkdir_error : EEXIST;
        configfs.taken--;
        return -1;
    }
    snprintf(kind, sizeof kind, "/functions/%s", configfs.no_function != NULL ? configfs.no_function : "?");
    if (strstr(path, kind) != NULL) return errno = ENOENT, -1;
    if (syscall(SYS_mkdirat, AT_FDCWD, real, mode) != 0) return -1;
    add_parts(path);
    if (strchr(name, '/') == NULL) lock_as_other(real);
    return 0;
}

static int is_group(const char *name)
{
    return strcmp(name, "strings") == 0 || strcmp(name, "configs") == 0 || strcmp(name, "functions") == 0 ||
           strcmp(name, "os_desc") == 0;
}

/* Goes through a directory: for_good 0: returns whether somebody made parts of it; 1: removes its attributes and
 * groups. */
static int walk(const char *real, int for_good)
{
    DIR *(*open_it)(const char *);
    void *found = next("opendir");
    memcpy(&open_it, &found, sizeof open_it);
    DIR *dir = open_it(real);
    int made = 0;
    for (struct dirent *entry; dir != NULL && (entry = readdir(dir)) != NULL;) {
        char path[PATH_ROOM + 300];
        struct stat st;
        if (entry->d_name[0] == '.') continue;
        snprintf(path, sizeof path, "%s/%s", real, entry->d_name);
        assert_int_equal(lstat(path, &st), 0);
        made |= S_ISLNK(st.st_mode) || (S_ISDIR(st.st_mode) && (!is_group(entry->d_name) || walk(path, for_good)));
        if (for_good) syscall(SYS_unlinkat, AT_FDCWD, path, S_ISDIR(st.st_mode) ? AT_REMOVEDIR : 0);
    }
    if (dir != NULL) closedir(dir);
    return made;
}

/* Whether a configuration has a link to this function. */
static int is_linked(const char *real)
{
    char link[PATH_ROOM];
    struct stat st;
    const char *at = strstr(real, "/functions/");
    if (at == NULL) return 0;
    snprintf(link, sizeof link, "%.*s/configs/c.1/%s", (int)(at - real), real, at + 11);
    return lstat(link, &st) == 0;
}

static int remove_item(const char *path, const char *real)
{
    struct stat st;
    if (lstat(real, &st) != 0) return -1;
    if (S_ISLNK(st.st_mode)) return (int)syscall(SYS_unlinkat, AT_FDCWD, real, 0);
    if (walk(real, 0)) return errno = ENOTEMPTY, -1;
    if (is_linked(real)) return errno = EBUSY, -1;
    const char *udc = strchr(path + sizeof CONFIGFS_GADGETS, '/') == NULL ? configfs_get(path, "UDC") : NULL;
    configfs.was_bound |= udc != NULL && udc[0] > ' ';
    walk(real, 1);
    return (int)syscall(SYS_unlinkat, AT_FDCWD, real, AT_REMOVEDIR);
}

int rmdir(const char *path)
{
    char to[PATH_ROOM];
    const char *real = moved(path, to);
    return real == path ? (int)syscall(SYS_unlinkat, AT_FDCWD, path, AT_REMOVEDIR) : remove_item(path, real);
}

int remove(const char *path)
{
    char to[PATH_ROOM];
    const char *real = moved(path, to);
    if (real != path) return remove_item(path, real);
    return unlink(path) == 0 || (errno == EISDIR && rmdir(path) == 0) ? 0 : -1;
}

int symlink(const char *from, const char *path)
{
    char to[PATH_ROOM];
    return (int)syscall(SYS_symlinkat, from, AT_FDCWD, moved(path, to));
}

DIR *opendir(const char *path)
{
    DIR *(*real)(const char *);
    void *found = next("opendir");
    char to[PATH_ROOM];
    memcpy(&real, &found, sizeof real);
    return real(moved(path, to));
}

/* ---- files */

int open(const char *path, int flags, ...)
{
    char to[PATH_ROOM];
    const char *real = moved(path, to);
    if (configfs.ep0 != 0 && is_attribute(path, "ep0")) return dup(configfs.ep0);
    if (configfs.tty != NULL && strcmp(path, "/dev/ttyGS3") == 0)
        return (int)syscall(SYS_openat, AT_FDCWD, configfs.tty, flags);
    if (real == path) return (int)syscall(SYS_openat, AT_FDCWD, path, flags, 0600);
    if ((flags & O_ACCMODE) == O_WRONLY && is_attribute(path, configfs.fails)) return errno = EIO, -1;
    const int fd = (int)syscall(SYS_openat, AT_FDCWD, real, flags | ((flags & O_ACCMODE) == O_WRONLY ? O_TRUNC : 0), 0);
    if (is_attribute(path, "UDC")) udc_fd = fd;
    return fd;
}

int close(int fd)
{
    if (fd == udc_fd) udc_fd = -1;
    return (int)syscall(SYS_close, fd);
}

/* The name of a controller that is not there, or that is busy, is refused. */
ssize_t write(int fd, const void *bytes, size_t len)
{
    char udc[80], path[160], to[PATH_ROOM];
    if (configfs.write_that_fails > 0 && --configfs.write_that_fails == 0) return errno = ENOSPC, -1;
    snprintf(udc, sizeof udc, "%.*s", len > 1 && len < sizeof udc ? (int)len - 1 : 0, (const char *)bytes);
    snprintf(path, sizeof path, "%s/%s", CONFIGFS_UDCS, udc);
    if (fd >= 0 && fd == udc_fd && udc[0] != '\0') {
        struct stat st;
        if (stat(moved(path, to), &st) != 0) return errno = ENODEV, -1;
        if (configfs.busy != NULL && strcmp(udc, configfs.busy) == 0) return errno = EBUSY, -1;
    }
    return syscall(SYS_write, fd, bytes, len);
}

int access(const char *path, int mode)
{
    char to[PATH_ROOM];
    if (configfs.tty != NULL && strcmp(path, "/dev/ttyGS3") == 0) return 0;
    if (strcmp(path, CONFIGFS_GADGETS) == 0) {
        errno = mode == W_OK ? EACCES : ENOENT;
        if (configfs.is_unmounted || configfs.has_none || (configfs.is_read_only && mode == W_OK)) return -1;
    }
    return (int)syscall(SYS_faccessat, AT_FDCWD, moved(path, to), mode);
}

int ioctl(int fd, unsigned long request, ...)
{
    va_list ap;
    va_start(ap, request);
    void *to = va_arg(ap, void *);
    va_end(ap);
    if (request != FUNCTIONFS_ENDPOINT_DESC || configfs.given[0] == 0) return (int)syscall(SYS_ioctl, fd, request, to);
    assert_in_range(configfs.n_given, 0, 1);
    *(struct usb_endpoint_descriptor *)to =
        (struct usb_endpoint_descriptor){.bEndpointAddress = configfs.given[configfs.n_given++]};
    return 0;
}

FILE *fopen(const char *path, const char *mode)
{
    FILE *(*real)(const char *, const char *);
    void *found = next("fopen");
    char to[PATH_ROOM];
    memcpy(&real, &found, sizeof real);
    if (strcmp(path, "/proc/self/mounts") == 0 && configfs.mounts != NULL) configfs_put(path, configfs.mounts);
    return real(moved(path, to), mode);
}

static const char *endpoint_in(const char *folder, int number)
{
    static char path[80];
    snprintf(path, sizeof path, "%s/ep%d", folder, number);
    return path;
}

int mount(const char *what, const char *where, const char *type, unsigned long flags, const void *data)
{
    assert_int_equal(flags, 0);
    assert_null(data);
    if (strcmp(type, "configfs") == 0) {
        assert_string_equal(where, "/sys/kernel/config");
        configfs.is_unmounted = 0;
        return 0;
    }
    assert_string_equal(type, "functionfs");
    if (configfs.mount_error != 0) {
        snprintf(configfs.refused, sizeof configfs.refused, "%s", where);
        return errno = configfs.mount_error, -1;
    }
    snprintf(configfs.mounted, sizeof configfs.mounted, "%s", what);
    snprintf(configfs.at, sizeof configfs.at, "%s", where);
    for (int i = 1; i <= 2; i++)
        assert_int_equal(mkfifo(endpoint_in(where, i), 0600), 0);
    return 0;
}

int umount2(const char *where, int flags)
{
    assert_int_equal(flags, MNT_DETACH);
    for (int i = 1; i <= 2; i++)
        unlink(endpoint_in(where, i));
    const size_t n = strlen(configfs.unmounted);
    snprintf(configfs.unmounted + n, sizeof configfs.unmounted - n, "%s ", where);
    return 0;
}

/* ---- the tests' side */

static int remove_one(const char *path, const struct stat *st, int type, struct FTW *ftw)
{
    (void)st, (void)ftw;
    return (int)syscall(SYS_unlinkat, AT_FDCWD, path, type == FTW_DP ? AT_REMOVEDIR : 0);
}

static int count_open(void)
{
    int n = 0;
    DIR *dir = opendir("/proc/self/fd");
    for (struct dirent *entry; dir != NULL && (entry = readdir(dir)) != NULL;)
        n += entry->d_name[0] != '.';
    closedir(dir);
    return n;
}

int configfs_set_up(void **state)
{
    static const char *const folders[] = {"/sys",           "/sys/kernel", "/sys/kernel/config",
                                          CONFIGFS_GADGETS, "/sys/class",  CONFIGFS_UDCS,
                                          "/proc",          "/proc/self"};
    (void)state;
    char path[80];
    configfs = (struct configfs){0};
    n_open = count_open();
    strcpy(root, "/dev/shm/configfs.XXXXXX"); /* hundreds of files: on a disk they take seconds */
    if (mkdtemp(root) == NULL && mkdtemp(strcpy(root, "/tmp/configfs.XXXXXX")) == NULL) return -1;
    for (size_t i = 0; i < sizeof folders / sizeof folders[0]; i++) {
        snprintf(path, sizeof path, "%s%s", root, folders[i]);
        if (syscall(SYS_mkdirat, AT_FDCWD, path, 0700) != 0) return -1;
    }
    return 0;
}

int configfs_tear_down(void **state)
{
    (void)state;
    char dir[sizeof root];
    memcpy(dir, root, sizeof dir);
    root[0] = '\0';
    if (other_head >= 0) close(other_head);
    other_head = -1;
    const int rc = nftw(dir, remove_one, 8, FTW_DEPTH | FTW_PHYS);
    if (count_open() != n_open) fail_msg("%d descriptors were open before, now %d", n_open, count_open());
    return rc;
}

const char *configfs_get(const char *dir, const char *name)
{
    static char text[200];
    char path[PATH_ROOM], to[PATH_ROOM];
    snprintf(path, sizeof path, "%s/%s", dir, name);
    const int fd = (int)syscall(SYS_openat, AT_FDCWD, moved(path, to), O_RDONLY);
    if (fd < 0) return NULL;
    const long n = syscall(SYS_read, fd, text, sizeof text - 1);
    syscall(SYS_close, fd);
    text[n > 0 ? n : 0] = '\0';
    return text;
}

const char *configfs_link(const char *dir, const char *name)
{
    static char text[300];
    char path[PATH_ROOM], to[PATH_ROOM];
    snprintf(path, sizeof path, "%s/%s", dir, name);
    const long n = readlink(moved(path, to), text, sizeof text - 1);
    if (n < 0) return NULL;
    text[n] = '\0';
    const size_t len = strlen(dir);
    return strncmp(text, dir, len) == 0 && text[len] == '/' ? text + len + 1 : text;
}

int configfs_count(void)
{
    int n = 0;
    DIR *dir = opendir(CONFIGFS_GADGETS);
    assert_non_null(dir);
    for (struct dirent *entry; (entry = readdir(dir)) != NULL;)
        n += entry->d_name[0] != '.';
    closedir(dir);
    return n;
}

void configfs_add_udc(const char *name, const char *state, const char *now, const char *most)
{
    const char *const file[] = {"state", "current_speed", "maximum_speed"}, *const text[] = {state, now, most};
    char path[160], to[PATH_ROOM];
    snprintf(path, sizeof path, "%s/%s", CONFIGFS_UDCS, name);
    (void)syscall(SYS_mkdirat, AT_FDCWD, moved(path, to), 0700);
    for (int i = 0; i < 3; i++) {
        snprintf(path, sizeof path, "%s/%s/%s", CONFIGFS_UDCS, name, file[i]);
        configfs_put(path, text[i]);
    }
}
