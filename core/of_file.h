/* SPDX-License-Identifier: MIT */
/* The one rule for errors of files that are read: wrong bytes of a file are wrong input, while those of a head break its
 * protocol. In: a code and its text (err.h). Out: SH_EINPUT for SH_EFORMAT, in err, too; any other code as it is. */
#ifndef CORE_OF_FILE_H
#define CORE_OF_FILE_H

#include <stddef.h>

#include "core/err.h"

static inline int sh_of_file(int code, struct sh_err *err)
{
    if (code != SH_EFORMAT) return code;
    if (err != NULL) err->code = SH_EINPUT;
    return SH_EINPUT;
}

#endif
