/* SPDX-License-Identifier: MIT */
#include <dirent.h>
#include <stdio.h>
#include <unistd.h>

#include "firmware_sim/app/studio/verdict/family.h"

enum { MAX_DEPTH = 32, PATH_BYTES = 320 };

struct look {
    int (*see)(void *ctx, pid_t pid);
    void *ctx;
};

static int any_below(const struct look *look, pid_t pid, int depth);

static int any_in_file(const struct look *look, const char *path, int depth)
{
    FILE *file = fopen(path, "r");
    int seen = 0, pid;
    while (file != NULL && !seen && fscanf(file, "%d", &pid) == 1)
        seen = any_below(look, pid, depth + 1) || look->see(look->ctx, pid);
    if (file != NULL) fclose(file);
    return seen;
}

/* Each thread has children of its own. */
static int any_below(const struct look *look, pid_t pid, int depth)
{
    char path[PATH_BYTES];
    int seen = 0;
    snprintf(path, sizeof path, "/proc/%d/task", (int)pid);
    DIR *threads = depth < MAX_DEPTH ? opendir(path) : NULL;
    for (struct dirent *entry; threads != NULL && !seen && (entry = readdir(threads)) != NULL;) {
        if (entry->d_name[0] == '.') continue;
        snprintf(path, sizeof path, "/proc/%d/task/%.20s/children", (int)pid, entry->d_name);
        seen = any_in_file(look, path, depth);
    }
    if (threads != NULL) closedir(threads);
    return seen;
}

int family_any(int (*see)(void *ctx, pid_t pid), void *ctx)
{
    const struct look look = {see, ctx};
    return any_below(&look, getpid(), 0);
}
