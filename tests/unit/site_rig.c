/* SPDX-License-Identifier: MIT */
#include "firmware_sim/config/config.h"
#include "tests/common/free_fd.h"
#include "tests/unit/site_rig.h"

enum { MAX_FILES = 8 };

char config_path[128], warned[4096];
struct config *cfg;
struct sh_err err;

static char dir[64], written[MAX_FILES][128];
static int n_written, fd_before;

static void keep_warning(void *ctx, const char *text)
{
    (void)ctx;
    size_t used = strlen(warned);
    snprintf(warned + used, sizeof warned - used, "%s\n", text);
}
const struct sh_report report = {.warn = keep_warning};

void clear_warned(void)
{
    warned[0] = '\0';
}

void write_in(const char *name, const char *text)
{
    char path[128];
    snprintf(path, sizeof path, "%s/%s", dir, name);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fputs(text, f);
    assert_int_equal(fclose(f), 0);
    for (int i = 0; i < n_written; i++)
        if (strcmp(written[i], path) == 0) return;
    assert_true(n_written < MAX_FILES);
    strcpy(written[n_written++], path);
}

int site_rig_setup(void **state)
{
    (void)state;
    char path[512];
    fd_before = free_fd();
    strcpy(dir, "/tmp/scanhead_site_XXXXXX");
    if (mkdtemp(dir) == NULL || getcwd(path, sizeof path - 16) == NULL) return -1;
    strcat(path, "/config/heads");
    setenv("SCANHEAD_HEADS", path, 1);
    snprintf(config_path, sizeof config_path, "%s/test.yaml", dir);
    return (cfg = calloc(1, sizeof *cfg)) != NULL ? 0 : -1;
}

int site_rig_teardown(void **state)
{
    (void)state;
    while (n_written > 0)
        remove(written[--n_written]);
    free(cfg);
    return rmdir(dir) != 0 ? -1 : free_fd_check(fd_before);
}
