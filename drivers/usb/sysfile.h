/* SPDX-License-Identifier: MIT */
/* Reads and writes files of sysfs and configfs, which hold one value each. All return 0, or -1 with errno. */
#ifndef DRIVERS_USB_SYSFILE_H
#define DRIVERS_USB_SYSFILE_H

#include <stddef.h>

/* Writes at most 127 bytes. */
int sysfile_write(const char *dir, const char *file, const char *fmt, ...) __attribute__((format(printf, 3, 4)));
/* Reads the first line, without its end. */
int sysfile_read(const char *dir, const char *file, char *text, size_t len);
int sysfile_mkdir(const char *dir, const char *name);
/* Makes the symlink name -> target, both within dir. */
int sysfile_link(const char *dir, const char *target, const char *name);

#endif
