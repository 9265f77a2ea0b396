/* SPDX-License-Identifier: MIT */
#include "drivers/usb/gadget.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <unistd.h>

#include "drivers/usb/sysfile.h"

static const char GADGETS[] = "/sys/kernel/config/usb_gadget";
static const char PREFIX[] = "scanhead-";

/* ---- gadgets of dead processes */

static void unmount(const char *name)
{
    char source[128], dir[256], type[64];
    FILE *mounts = fopen("/proc/self/mounts", "r");
    if (mounts == NULL) return;
    while (fscanf(mounts, "%127s %255s %63s%*[^\n]", source, dir, type) == 3)
        if (strcmp(type, "functionfs") == 0 && strcmp(source, name) == 0 && umount2(dir, MNT_DETACH) == 0) rmdir(dir);
    fclose(mounts);
}

/* Removes everything of that name, in the order that configfs allows. Parts that are not there are skipped. */
static void remove_all(const char *name)
{
    static const struct {
        const char *path;
        int named; /* the gadget's name follows */
    } part[] = {
        {"configs/c.1/acm.", 1}, {"configs/c.1/ffs.", 1}, {"os_desc/c.1", 0},    {"configs/c.1/strings/0x409", 0},
        {"configs/c.1", 0},      {"functions/acm.", 1},   {"functions/ffs.", 1}, {"strings/0x409", 0}};
    char dir[128], path[512];
    snprintf(dir, sizeof dir, "%s/%s", GADGETS, name);
    if (access(dir, F_OK) == 0) (void)sysfile_write(dir, "UDC", "\n");
    unmount(name);
    for (size_t i = 0; i < sizeof part / sizeof part[0]; i++) {
        snprintf(path, sizeof path, "%s/%s%s", dir, part[i].path, part[i].named ? name : "");
        remove(path); /* a link or a directory */
    }
    rmdir(dir);
}

/* When a process was started, in clock ticks from the machine's start: proc(5), stat, field 22. 0 or -1 with
 * errno. */
static int started_at(long pid, unsigned long long *ticks)
{
    char dir[32], text[1024];
    snprintf(dir, sizeof dir, "/proc/%ld", pid);
    if (sysfile_read(dir, "stat", text, sizeof text) != 0) return -1;
    const char *at = strrchr(text, ')'); /* field 2, the name, may hold anything */
    for (int field = 2; at != NULL && field < 22; field++)
        at = strchr(at + 1, ' ');
    if (at != NULL && sscanf(at, "%llu", ticks) == 1) return 0;
    errno = EPROTO;
    return -1;
}

/* Opens a gadget's directory and locks it. The kernel takes the lock back with the process. configfs is one for all PID
 * namespaces, but numbers of processes differ: the lock shows that a gadget of another container is in use. Returns the
 * descriptor; -1: another process has the lock, or there is no such gadget. */
static int lock_gadget(const char *name)
{
    char dir[512];
    snprintf(dir, sizeof dir, "%s/%s", GADGETS, name);
    const int fd = open(dir, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0 || flock(fd, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return fd;
    close(fd);
    errno = EWOULDBLOCK;
    return -1;
}

/* Locks a gadget if the process that made it is gone: there is none of that number here, or a later one has got the
 * number, and none anywhere has the gadget locked. Returns the descriptor; -1: the gadget is in use, or no head's. */
static int lock_left_behind(const char *name)
{
    long pid;
    unsigned long long start, now;
    if (strncmp(name, PREFIX, sizeof PREFIX - 1) != 0) return -1;
    if (sscanf(name + sizeof PREFIX - 1, "%ld-%llu-", &pid, &start) != 2 || pid <= 0) return -1;
    const int is_other = started_at(pid, &now) == 0 ? now != start : errno == ENOENT || errno == ESRCH;
    return is_other ? lock_gadget(name) : -1;
}

static void remove_left_behind(void)
{
    DIR *dir = opendir(GADGETS);
    if (dir == NULL) return;
    for (struct dirent *entry; (entry = readdir(dir)) != NULL;) {
        const int fd = lock_left_behind(entry->d_name);
        if (fd < 0) continue;
        remove_all(entry->d_name);
        close(fd);
    }
    closedir(dir);
}

/* ---- making it */

static int is_console(const struct usb_function_row *function)
{
    return function->class == USB_CLASS_COMM && function->subclass == 2;
}

static uint8_t take_string(struct gadget *gadget, const struct usb_model *model, uint8_t index)
{
    unsigned n = 0;
    if (index == 0) return 0;
    while (gadget->string[n] != NULL)
        n++;
    gadget->string[n] = model->string[index - 1];
    return (uint8_t)(n + 1);
}

/* Sets gadget->part: the model without its console, if it has one, numbered from 0. */
static int take_part(struct gadget *gadget, const struct usb_model *model, struct sh_err *err)
{
    struct usb_model *part = &gadget->part;
    *part = *model;
    part->function = gadget->function;
    part->interface = gadget->row;
    part->string = gadget->string;
    part->n_functions = part->n_interfaces = 0;
    gadget->tty_number = -1;
    for (unsigned f = 0; f < model->n_functions; f++) {
        const struct usb_function_row *from = &model->function[f];
        if (is_console(from)) {
            if (gadget->tty_number != -1 || f != 0)
                return sh_fail(err, SH_EINPUT,
                               "functionfs: allowed is one console, before all other interfaces of the device");
            gadget->tty_number = 0;
            continue;
        }
        struct usb_function_row *to = &gadget->function[part->n_functions++];
        *to = *from;
        to->first = part->n_interfaces;
        to->string = take_string(gadget, model, from->string);
        for (unsigned i = from->first; i < (unsigned)from->first + from->count; i++) {
            gadget->interface[part->n_interfaces] = (uint8_t)i;
            struct usb_interface_row *row = &gadget->row[part->n_interfaces];
            *row = model->interface[i];
            row->number = part->n_interfaces++;
            row->string = take_string(gadget, model, row->string);
        }
    }
    return SH_OK;
}

static int look_for_configfs(struct sh_err *err)
{
    if (access(GADGETS, F_OK) != 0) (void)mount("configfs", "/sys/kernel/config", "configfs", 0, NULL);
    if (access(GADGETS, F_OK) != 0)
        return sh_fail(err, SH_EINPUT,
                       "functionfs: %s is not there: modprobe libcomposite, and mount -t configfs none "
                       "/sys/kernel/config (as root)",
                       GADGETS);
    if (access(GADGETS, W_OK) != 0)
        return sh_fail(err, SH_EPERM, "functionfs: %s: %s; only root may make gadgets", GADGETS, strerror(errno));
    return SH_OK;
}

/* Makes the gadget's directory and locks it. Until it is locked, a head of another container may take it for one that
 * was left behind, and remove it: then the next number may do. Returns 0; -1: errno has the reason, EEXIST in this
 * case. */
static int make_locked_dir(struct gadget *gadget)
{
    if (mkdir(gadget->dir, 0755) != 0) return -1;
    gadget->lock_fd = lock_gadget(gadget->name);
    if (gadget->lock_fd >= 0 && access(gadget->dir, F_OK) == 0) return 0;
    const int error = gadget->lock_fd >= 0 || errno == EWOULDBLOCK || errno == ENOENT ? EEXIST : errno;
    if (gadget->lock_fd >= 0) close(gadget->lock_fd);
    gadget->lock_fd = -1;
    rmdir(gadget->dir);
    errno = error;
    return -1;
}

static int make_named_dir(struct gadget *gadget, struct sh_err *err)
{
    const long pid = (long)getpid();
    unsigned long long start;
    if (started_at(pid, &start) != 0)
        return sh_fail(err, SH_EIO, "functionfs: /proc/%ld/stat: %s", pid, strerror(errno));
    for (int i = 0; i < 100; i++) {
        snprintf(gadget->name, sizeof gadget->name, "%s%ld-%llu-%d", PREFIX, pid, start, i);
        snprintf(gadget->dir, sizeof gadget->dir, "%s/%s", GADGETS, gadget->name);
        if (make_locked_dir(gadget) == 0) return SH_OK;
        if (errno != EEXIST) break;
    }
    int error = errno;
    gadget->dir[0] = '\0';
    return sh_fail(err, error == EPERM || error == EACCES ? SH_EPERM : SH_EIO, "functionfs: no gadget in %s: %s",
                   GADGETS, strerror(error));
}

static int write_string(const char *dir, const char *file, const struct usb_model *model, uint8_t index)
{
    return index != 0 ? sysfile_write(dir, file, "%s", model->string[index - 1]) : 0;
}

/* In this function and the next two, each step needs the steps before it. The first step that fails ends the function,
 * and sets errno. */
static int write_os_descriptors(const char *dir, const struct usb_model *model)
{
    return sysfile_write(dir, "os_desc/use", "1") ||
           sysfile_write(dir, "os_desc/b_vendor_code", "0x%02x", model->ms_vendor_code) ||
           sysfile_write(dir, "os_desc/qw_sign", "MSFT100") || sysfile_link(dir, "configs/c.1", "os_desc/c.1");
}

static int write_identity(const struct gadget *gadget, const struct usb_model *model, const struct usb_identity *id)
{
    const char *dir = gadget->dir;
    if (sysfile_write(dir, "max_speed", "%s-speed", gadget_rate_name(id->highest)) != 0 && errno != ENOENT)
        return -1; /* Linux before 5.12 has no max_speed: ENOENT is no failure */
    return sysfile_write(dir, "idVendor", "0x%04x", id->vid) || sysfile_write(dir, "idProduct", "0x%04x", id->pid) ||
           sysfile_write(dir, "bcdUSB", usb_describe_ms_os(model, NULL, 0) != 0 ? "0x0210" : "0x0200") ||
           sysfile_write(dir, "bcdDevice", "0x%04x", model->bcd_device) ||
           sysfile_write(dir, "bDeviceClass", "0x%02x", model->class) ||
           sysfile_write(dir, "bDeviceSubClass", "0x%02x", model->subclass) ||
           sysfile_write(dir, "bDeviceProtocol", "0x%02x", model->protocol) || sysfile_mkdir(dir, "strings/0x409") ||
           write_string(dir, "strings/0x409/manufacturer", model, model->manufacturer) ||
           write_string(dir, "strings/0x409/product", model, model->product) ||
           (id->serial[0] != '\0' ? sysfile_write(dir, "strings/0x409/serialnumber", "%s", id->serial) : 0);
}

static int write_configuration(const struct gadget *gadget, const struct usb_model *model)
{
    const char *dir = gadget->dir;
    return sysfile_mkdir(dir, "configs/c.1") ||
           sysfile_write(dir, "configs/c.1/bmAttributes", "0x%02x", usb_is_self_powered(model) ? 0xc0 : 0x80) ||
           sysfile_write(dir, "configs/c.1/MaxPower", "%u", model->max_power_ma) ||
           (model->configuration != 0 ? sysfile_mkdir(dir, "configs/c.1/strings/0x409") : 0) ||
           write_string(dir, "configs/c.1/strings/0x409/configuration", model, model->configuration) ||
           (usb_describe_ms_os(model, NULL, 0) != 0 ? write_os_descriptors(dir, model) : 0);
}

/* Sets the model's protocol for f_acm, which reports AT commands (1) by default. Older kernels (Debian's 6.1) can't set
 * it, newer ones (6.12) only before the function is in a configuration. */
static int set_console_protocol(const struct gadget *gadget, const struct usb_model *model, struct sh_err *err)
{
    char file[96];
    snprintf(file, sizeof file, "functions/acm.%s/protocol", gadget->name);
    if (sysfile_write(gadget->dir, file, "%u", model->function[0].protocol) == 0 || errno == ENOENT) return SH_OK;
    return sh_fail(err, SH_EIO, "functionfs: %s/%s: %s", gadget->dir, file, strerror(errno));
}

/* Makes a function, and adds it to the configuration. The console's comes first, since it has the first interfaces. */
static int make_function(struct gadget *gadget, const char *kind, const struct usb_model *model, struct sh_err *err)
{
    char function[80], link[96];
    snprintf(function, sizeof function, "functions/%s.%s", kind, gadget->name);
    snprintf(link, sizeof link, "configs/c.1/%s.%s", kind, gadget->name);
    if (sysfile_mkdir(gadget->dir, function) != 0)
        return errno == ENOENT
                   ? sh_fail(err, SH_EINPUT, "functionfs: the kernel has no such function: modprobe usb_f_%s",
                             strcmp(kind, "ffs") == 0 ? "fs" : kind)
                   : sh_fail(err, SH_EIO, "functionfs: %s/%s: %s", gadget->dir, function, strerror(errno));
    int rc = strcmp(kind, "acm") == 0 ? set_console_protocol(gadget, model, err) : SH_OK;
    if (rc == SH_OK && sysfile_link(gadget->dir, function, link) != 0)
        rc = sh_fail(err, SH_EIO, "functionfs: %s/%s: %s", gadget->dir, link, strerror(errno));
    return rc;
}

static int find_tty(struct gadget *gadget, struct sh_err *err)
{
    char file[96], text[16];
    snprintf(file, sizeof file, "functions/acm.%s/port_num", gadget->name);
    if (sysfile_read(gadget->dir, file, text, sizeof text) != 0)
        return sh_fail(err, SH_EIO, "functionfs: %s/%s: %s", gadget->dir, file, strerror(errno));
    gadget->tty_number = atoi(text);
    return SH_OK;
}

static int mount_instance(struct gadget *gadget, struct sh_err *err)
{
    char dir[] = "/tmp/scanhead-ffs-XXXXXX";
    if (mkdtemp(dir) == NULL) return sh_fail(err, SH_EIO, "functionfs: %s: %s", dir, strerror(errno));
    if (mount(gadget->name, dir, "functionfs", 0, NULL) != 0) {
        int error = errno;
        rmdir(dir);
        return sh_fail(err, error == EPERM ? SH_EPERM : SH_EIO, "functionfs: cannot be mounted: %s%s", strerror(error),
                       error == ENODEV ? "; modprobe usb_f_fs" : "");
    }
    snprintf(gadget->mount, sizeof gadget->mount, "%s", dir);
    return SH_OK;
}

int gadget_create(struct gadget *gadget, const struct usb_model *model, const struct usb_identity *id,
                  struct sh_err *err)
{
    memset(gadget, 0, sizeof *gadget);
    gadget->state_fd = gadget->lock_fd = -1;
    int rc = take_part(gadget, model, err);
    if (rc == SH_OK) rc = look_for_configfs(err);
    if (rc != SH_OK) return rc;
    remove_left_behind();
    rc = make_named_dir(gadget, err);
    if (rc == SH_OK && (write_identity(gadget, model, id) != 0 || write_configuration(gadget, model) != 0))
        rc = sh_fail(err, SH_EIO, "functionfs: %s cannot be filled in: %s", gadget->dir, strerror(errno));
    if (rc == SH_OK && gadget->tty_number >= 0) rc = make_function(gadget, "acm", model, err);
    if (rc == SH_OK && gadget->tty_number >= 0) rc = find_tty(gadget, err);
    if (rc == SH_OK && gadget_has_functionfs(gadget)) rc = make_function(gadget, "ffs", model, err);
    if (rc == SH_OK && gadget_has_functionfs(gadget)) rc = mount_instance(gadget, err);
    if (rc != SH_OK) gadget_remove(gadget);
    return rc;
}

void gadget_remove(struct gadget *gadget)
{
    gadget_unbind(gadget);
    if (gadget->state_fd >= 0) close(gadget->state_fd);
    if (gadget->lock_fd >= 0) close(gadget->lock_fd);
    gadget->state_fd = gadget->lock_fd = -1;
    if (gadget->mount[0] != '\0' && umount2(gadget->mount, MNT_DETACH) == 0) rmdir(gadget->mount);
    if (gadget->dir[0] != '\0') remove_all(gadget->name);
    gadget->dir[0] = gadget->mount[0] = '\0';
}
