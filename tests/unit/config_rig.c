/* SPDX-License-Identifier: MIT */
#include "firmware_sim/config/load.h"
#include "tests/common/free_fd.h"
#include "tests/unit/config_rig.h"

const char base[] = "head:\n"                     /* 1 */
                    "  profile: any-rate\n"       /* 2 */
                    "  prr_hz: 500000\n"          /* 3 */
                    "  lines_hz: 100\n"           /* 4 */
                    "scene:\n"                    /* 5 */
                    "  meshes:\n"                 /* 6 */
                    "    - file: cube.obj\n"      /* 7 */
                    "      up: z\n"               /* 8 */
                    "      scale: 1\n"            /* 9 */
                    "stations:\n"                 /* 10 */
                    "  - position_m: [1, 2, 3]\n" /* 11 */
                    "    heading_deg: 90\n"       /* 12 */
                    "links:\n"                    /* 13 */
                    "  - type: tcp\n"             /* 14 */
                    "    port: 0\n"               /* 15 */
                    "output:\n"                   /* 16 */
                    "  crs: local\n";

char dir[64], config_path[128];
struct config *cfg;
struct sh_err err;
struct config_diagnostics diagnostics;
static int fd_before;

void write_file(const char *path, const void *bytes, size_t len)
{
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, len, file), len);
    assert_int_equal(fclose(file), 0);
}

void write_in(const char *name, const char *text)
{
    char path[256];
    snprintf(path, sizeof path, "%s/%s", dir, name);
    write_file(path, text, strlen(text));
}

int load_sets(const char *const *sets, int n)
{
    memset(&err, 0, sizeof err);
    int code = config_load_all(config_path, sets, n, cfg, &diagnostics);
    if (code != SH_OK) err = diagnostics.err[0];
    return code;
}

int load_text(const char *text)
{
    write_file(config_path, text, strlen(text));
    return load_sets(NULL, 0);
}

char *replaced(const char *text, const char *old, const char *with)
{
    const char *at = strstr(text, old);
    char *out = NULL;
    if (at == NULL) fail_msg("there is no %s", old);
    assert_true(asprintf(&out, "%.*s%s%s", (int)(at - text), text, with, at + strlen(old)) >= 0);
    return out;
}

char *edited(const char *old, const char *with)
{
    return replaced(base, old, with);
}

int load_edited(const char *old, const char *with)
{
    char *text = edited(old, with);
    int code = load_text(text);
    free(text);
    return code;
}

int load_set(const char *set)
{
    const char *const sets[] = {set};
    write_file(config_path, base, sizeof base - 1);
    return load_sets(sets, 1);
}

int load_with_head(const char *profile, const char *settings, const char *with)
{
    char head[512], rest[1024];
    snprintf(head, sizeof head, "%s\n%s", profile, settings);
    snprintf(rest, sizeof rest, "%soutput:", with);
    char *text = edited("any-rate\n" PRR LINES, head), *whole = replaced(text, "output:", rest);
    int code = load_text(whole);
    free(text);
    free(whole);
    return code;
}

char *read_source(const char *path)
{
    char *text = NULL;
    size_t size = 0;
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    assert_true(getdelim(&text, &size, '\0', file) > 0);
    fclose(file);
    return text;
}

int load_changed(const char *profile, const char *old, const char *with)
{
    char path[128];
    snprintf(path, sizeof path, "config/heads/%s.yaml", profile);
    char *text = read_source(path), *changed = replaced(text, old, with);
    write_in("heads/mine.yaml", changed);
    free(text);
    free(changed);
    return load_with_head("mine", "", "");
}

void place_in_profile(const char *key, char *buf, size_t len)
{
    char path[128], start[64];
    snprintf(path, sizeof path, "%s/heads/mine.yaml", dir);
    snprintf(start, sizeof start, "\n%.*s:", (int)strcspn(key, "[."), key);
    char *text = read_source(path), *at = strstr(text, start);
    for (int item = at != NULL && strchr(key, '[') != NULL ? atoi(strchr(key, '[') + 1) : -1; item >= 0; item--)
        at = strstr(at + 1, "\n  - ");
    if (at == NULL) at = strstr(text, "\nmaker:"); /* below the comments */
    int line = 1;
    for (const char *p = text; p < at + 1; p++)
        line += *p == '\n';
    snprintf(buf, len, "%s:%d: %s: ", path, line, key);
    free(text);
}

void assert_loads(int code)
{
    if (code != SH_OK) fail_msg("%s", err.text);
}

void expect_only(const char *place, const char *key, const char *text)
{
    char want[1200];
    snprintf(want, sizeof want, "%s%s: %s", place, key, text);
    if (err.code != SH_EINPUT || strcmp(err.text, want) != 0) fail_msg("\"%s\"\nexpected \"%s\"", err.text, want);
    if (diagnostics.n != 1) fail_msg("%s; also %s", text, diagnostics.err[1].text);
}

void assert_says(const char *fragment)
{
    assert_int_equal(err.code, SH_EINPUT);
    assert_null(strchr(err.text, '\n'));
    if (strstr(err.text, fragment) == NULL) fail_msg("\"%s\" says nothing of \"%s\"", err.text, fragment);
}

int set_up(void **state)
{
    (void)state;
    char path[512];
    fd_before = free_fd();
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

int tear_down(void **state)
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
    return free_fd_check(fd_before);
}
