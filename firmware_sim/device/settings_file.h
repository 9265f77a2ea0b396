/* SPDX-License-Identifier: MIT */
/* Settings that a device keeps without power, in a file: those that a client's store command has stored.
 *
 * In: text under a name (a protocol's, or "head"), as lines of printable ASCII. Out: the same text, at once and after a
 * new start. The file (head.settings_file) is a text, too:
 *
 *   scanhead settings 1
 *   profile NAME                  of the head whose settings these are
 *   NAME LINE                     any number of them; the lines of a name are in their order
 *   end
 *
 * A thread writes the file, as a new one that takes the place of the old one, so the file is always whole. Only
 * opening, checking and closing it wait for a disk. The file is locked as long as it is open here. */
#ifndef FIRMWARE_SIM_DEVICE_SETTINGS_FILE_H
#define FIRMWARE_SIM_DEVICE_SETTINGS_FILE_H

#include "core/err.h"

struct settings_file;

/* Reads the file, or makes an empty one. path and profile must outlive it. SH_EINPUT: the file is broken, of another
 * form or head profile, or another process has it; also SH_EIO and SH_ENOMEM. report takes a failure to write; NULL:
 * nobody does. */
int settings_file_open(const char *path, const char *profile, const struct sh_report *report,
                       struct settings_file **out, struct sh_err *err);

/* Reads the file as settings_file_open does, but neither makes nor writes it, and a head may have it. A missing file is
 * no error where it could be made. What is put is then only kept in memory. */
int settings_file_look(const char *path, const char *profile, struct settings_file **out, struct sh_err *err);

/* Replaces what is stored under a name: whole lines with their '\n'; empty: nothing is stored there any more.
 * SH_EINPUT: a line is empty, too long, not printable ASCII or without its end; the text is too long; the name has
 * more than 31 bytes, or is a ninth one. Nothing changes then. Any thread; never waits for the file. */
int settings_file_put(struct settings_file *file, const char *name, const char *text);

enum { SETTINGS_FILE_TEXT = 2048 }; /* of all that is stored under a name, with the NUL */

/* Copies what is stored under a name; "" where nothing is. Any thread. */
void settings_file_get(struct settings_file *file, const char *name, char text[SETTINGS_FILE_TEXT]);

const char *settings_file_path(const struct settings_file *file);

/* Writes what is not written yet, and frees. Returns the error of the last write, where it failed. NULL is allowed. */
int settings_file_close(struct settings_file *file, struct sh_err *err);

#endif
