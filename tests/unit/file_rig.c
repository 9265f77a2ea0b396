/* SPDX-License-Identifier: MIT */
#include "tests/unit/file_rig.h"

#include <stdlib.h>
#include <unistd.h>

char file_path[] = "/tmp/scanhead-file-XXXXXX";

int make_file(void **state)
{
    (void)state;
    const int fd = mkstemp(file_path);
    return fd < 0 ? -1 : close(fd);
}

int remove_file(void **state)
{
    (void)state;
    return unlink(file_path);
}
