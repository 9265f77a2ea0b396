/* SPDX-License-Identifier: MIT */
/* A kernel's configfs and its device controllers, in a folder. Calls of the C library with paths below
 * /sys/kernel/config and /sys/class/udc, and with /proc/self/mounts, go there. As configfs does, it makes the
 * attributes of a new directory, and refuses to remove a directory that has parts, or that a configuration is linked
 * to: Documentation/usb/gadget_configfs.rst of the kernel. A mounted FunctionFS has the FIFOs ep1 and ep2. Tests with
 * the kernel's own configfs are in tests/guest. */
#ifndef TESTS_UNIT_CONFIGFS_RIG_H
#define TESTS_UNIT_CONFIGFS_RIG_H

#include "tests/common/cases.h"

#define CONFIGFS_GADGETS "/sys/kernel/config/usb_gadget"
#define CONFIGFS_UDCS    "/sys/class/udc"

/* The kernel that the calls meet. Zeros: nothing fails. */
extern struct configfs {
    int is_unmounted;        /* configfs can be mounted, and is not yet */
    int has_none;            /* not even that */
    int is_read_only;        /* for this user */
    const char *no_function; /* a kind without its module: "acm", "ffs" */
    const char *no_file;     /* an attribute that this kernel doesn't have */
    const char *fails;       /* an attribute that can't be written: EIO */
    int mkdir_error;         /* errno for each new gadget */
    int taken;               /* names that exist already: so many new gadgets fail */
    int locks_first;         /* so many new gadgets are locked by another head before their own does */
    int mount_error;         /* errno for FunctionFS */
    const char *mounts;      /* /proc/self/mounts */
    int write_that_fails;    /* the n-th from now: ENOSPC */
    const char *busy;        /* a controller that another gadget has */
    int ep0;                 /* the kernel's FunctionFS; 0: none. A socket pair's end stands for it */
    const char *tty;         /* the terminal that stands for /dev/ttyGS3 */
    uint8_t given[2];        /* the addresses that the controller gives, in the order asked for; 0: it doesn't say */
    unsigned n_given;
    char mounted[64], at[64]; /* the last FunctionFS and its folder */
    char refused[64];         /* the last folder of a mount that failed */
    char unmounted[200];      /* folders, with a blank after each */
    int was_bound;            /* a gadget was removed while it was bound */
} configfs;

int configfs_set_up(void **state);
/* Fails if descriptors were left open. */
int configfs_tear_down(void **state);
/* Returns the text of a file in a folder; NULL: there is none. */
const char *configfs_get(const char *dir, const char *name);
/* Returns where a link in a folder leads to, without the folder. */
const char *configfs_link(const char *dir, const char *name);
/* Returns the number of gadgets. */
int configfs_count(void);
/* Makes a controller with these texts in its files. */
void configfs_add_udc(const char *name, const char *state, const char *now, const char *most);
/* Writes a file below the folder. */
void configfs_put(const char *path, const char *text);

#endif
