/* SPDX-License-Identifier: MIT */
/* Text within a double-quoted scalar of YAML. In: UTF-8. Out: the same text as YAML reads it back. Any thread. */
#ifndef FIRMWARE_SIM_CONFIG_ESCAPE_H
#define FIRMWARE_SIM_CONFIG_ESCAPE_H

#include <stddef.h>

enum { CONFIG_ESCAPE_ROOM = 8 }; /* of one character, with its NUL */

/* Writes the first character of p, which is not empty, or an escape for it. Quotes, backslashes and control characters
 * need one, and so do the line ends U+0085, U+2028 and U+2029, which YAML would fold into a blank, and U+FEFF, U+FFFE
 * and U+FFFF. Returns how many bytes of p were taken. */
size_t config_escape(const char *p, char out[CONFIG_ESCAPE_ROOM]);

#endif
