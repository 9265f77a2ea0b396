/* For tests of the configuration: one that loads, edits of it in a folder of their own, and what they load as. Run from
 * the top of the source tree. */
#ifndef TESTS_UNIT_CONFIG_RIG_H
#define TESTS_UNIT_CONFIG_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <cmocka.h>

#include "firmware_sim/config/table.h"

/* clang-format off */
static const char base[] = "head:\n"                        /* 1 */
                           "  profile: riegl-vz400i\n"      /* 2 */
                           "  prr_hz: 500000\n"             /* 3 */
                           "  lines_hz: 100\n"              /* 4 */
                           "scene:\n"                       /* 5 */
                           "  meshes:\n"                    /* 6 */
                           "    - file: cube.obj\n"         /* 7 */
                           "      up: z\n"                  /* 8 */
                           "      scale: 1\n"               /* 9 */
                           "stations:\n"                    /* 10 */
                           "  - position_m: [1, 2, 3]\n"    /* 11 */
                           "    heading_deg: 90\n"          /* 12 */
                           "links:\n"                       /* 13 */
                           "  - type: tcp\n"                /* 14 */
                           "    port: 0\n"                  /* 15 */
                           "output:\n"                      /* 16 */
                           "  crs: local\n";                /* 17 */
/* clang-format on */

#define PRR   "  prr_hz: 500000\n"
#define LINES "  lines_hz: 100\n"

static char dir[64], config_path[128];
static struct config *cfg;
static struct sh_err err;

static inline void write_file(const char *path, const void *bytes, size_t len)
{
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, len, file), len);
    assert_int_equal(fclose(file), 0);
}

static inline void write_in(const char *name, const char *text)
{
    char path[256];
    snprintf(path, sizeof path, "%s/%s", dir, name);
    write_file(path, text, strlen(text));
}

static inline int load_sets(const char *const *sets, int n)
{
    memset(&err, 0, sizeof err);
    return config_load(config_path, sets, n, cfg, &err);
}

static inline int load_text(const char *text)
{
    write_file(config_path, text, strlen(text));
    return load_sets(NULL, 0);
}

/* base with its first `old` replaced by `with` */
static inline char *edited(const char *old, const char *with)
{
    const char *at = strstr(base, old);
    assert_non_null(at);
    char *text = malloc(sizeof base + strlen(with));
    assert_non_null(text);
    sprintf(text, "%.*s%s%s", (int)(at - base), base, with, at + strlen(old));
    return text;
}

static inline int load_edited(const char *old, const char *with)
{
    char *text = edited(old, with);
    int code = load_text(text);
    free(text);
    return code;
}

static inline int load_set(const char *set)
{
    const char *const sets[] = {set};
    write_file(config_path, base, sizeof base - 1);
    return load_sets(sets, 1);
}

static inline void assert_loads(int code)
{
    if (code != SH_OK) fail_msg("%s", err.text);
}

static inline void assert_says(const char *fragment)
{
    assert_int_equal(err.code, SH_EINPUT);
    assert_null(strchr(err.text, '\n'));
    if (strstr(err.text, fragment) == NULL) fail_msg("\"%s\" says nothing of \"%s\"", err.text, fragment);
}

static inline int set_up(void **state)
{
    (void)state;
    char path[512];
    snprintf(dir, sizeof dir, "/tmp/test_config.XXXXXX");
    if (mkdtemp(dir) == NULL || getcwd(path, sizeof path - 16) == NULL) return -1;
    strcat(path, "/config/heads");
    setenv("SCANHEAD_HEADS", path, 1);
    snprintf(config_path, sizeof config_path, "%s/test.yaml", dir);
    snprintf(path, sizeof path, "%s/heads", dir);
    if (mkdir(path, 0700) != 0) return -1;
    snprintf(path, sizeof path, "%s/dir.obj", dir);
    if (mkdir(path, 0700) != 0) return -1;
    write_in("cube.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    cfg = malloc(sizeof *cfg);
    return cfg == NULL ? -1 : 0;
}

static inline int tear_down(void **state)
{
    (void)state;
    static const char *const made[] = {"test.yaml", "cube.obj", "heads/mine.yaml", "first/mine.yaml",
                                       "first",     "heads",    "dir.obj",         ""};
    char path[256];
    free(cfg);
    for (size_t i = 0; i < sizeof made / sizeof made[0]; i++) {
        snprintf(path, sizeof path, "%s/%s", dir, made[i]);
        remove(path);
    }
    return 0;
}

#endif
