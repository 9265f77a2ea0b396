/* SPDX-License-Identifier: MIT */
#include "tests/unit/file_rig.h"

#include <stdlib.h>
#include <unistd.h>

#include "tests/common/free_fd.h"

char file_path[] = "/tmp/scanhead-file-XXXXXX";
static int fd_before;

int make_file(void **state)
{
    (void)state;
    fd_before = free_fd();
    const int fd = mkstemp(file_path);
    return fd < 0 ? -1 : close(fd);
}

int remove_file(void **state)
{
    (void)state;
    return unlink(file_path) != 0 ? -1 : free_fd_check(fd_before);
}
