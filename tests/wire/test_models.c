/* SPDX-License-Identifier: MIT */
/* Every model of Debian's assimp-testmodels whose ending the scene reader takes. `scanhead init` and `scanhead record`
 * with no further key scan it, or refuse it with a reason that names the remedy. Nothing crashes or hangs. The counts
 * are printed. One model in six is scanned; all with THOROUGH=1. */
#define _XOPEN_SOURCE 700
#include "tests/common/thorough.h"
#include "tests/wire/wire.h"

#include <ftw.h>
#include <strings.h>

enum { MAX_MODELS = 512, AT_ONCE = 2 };

static char *model[MAX_MODELS];
static int n_models, status[MAX_MODELS];

static int take_file(const char *path, const struct stat *st, int type, struct FTW *at)
{
    static const char *const endings[] = {".obj", ".ply", ".stl", ".gltf", ".glb", ".fbx", ".dae", ".ifc"};
    (void)st, (void)at;
    const char *dot = strrchr(path, '.');
    for (size_t i = 0; type == FTW_F && dot != NULL && i < sizeof endings / sizeof endings[0]; i++)
        if (strcasecmp(dot, endings[i]) == 0 && n_models < MAX_MODELS) model[n_models++] = strdup(path);
    return 0;
}

static int compare(const void *a, const void *b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

static const char *name_of(const struct wire *wire, int i, const char *ending)
{
    char name[32];
    snprintf(name, sizeof name, "%03d%s", i, ending);
    return wire_path(wire, name);
}

/* An error is the last line, and begins with the program's name. Warnings are before it. */
static void check_reason(const struct wire *wire, int i, int *single, int *empty, int *broken)
{
    char *text = wire_read(name_of(wire, i, ".init"), NULL);
    const char *line = strstr(text, "scanhead: /");
    if (line == NULL) line = strstr(text, "scanhead: ");
    assert_non_null(line);
    if (strstr(text, "export it again") == NULL && strstr(text, "convert it") == NULL &&
        strstr(text, "--scale") == NULL && strstr(text, "tolerance_m") == NULL && strstr(text, "copy it there") == NULL)
        fail_msg("%s: refused, and nothing says what to do: %s", model[i], text);
    if (strstr(text, "single precision") != NULL)
        ++*single;
    else if (strstr(text, "no triangles") != NULL || strstr(text, "points are not a mesh") != NULL ||
             strstr(text, "no faces") != NULL || strstr(text, "No scene") != NULL)
        ++*empty;
    else
        ++*broken;
    free(text);
}

/* Runs some at a time, and waits for the oldest. `start` returns 0 where there is nothing to do. */
static void run_all(struct wire *wire, pid_t (*start)(struct wire *wire, int i))
{
    pid_t pid[MAX_MODELS + AT_ONCE] = {0};
    for (int i = 0; i < n_models + AT_ONCE; i++) {
        if (i >= AT_ONCE && pid[i - AT_ONCE] != 0) status[i - AT_ONCE] = wire_wait(wire, pid[i - AT_ONCE]);
        if (i < n_models) pid[i] = start(wire, i);
    }
}

static pid_t start_init(struct wire *wire, int i)
{
    char err[16];
    snprintf(err, sizeof err, "%03d.init", i);
    const char *const args[] = {"init", model[i], "-o", name_of(wire, i, ".yaml"), NULL};
    return wire_spawn(wire, args, "out", err, -1);
}

static pid_t start_record(struct wire *wire, int i)
{
    char err[16];
    if (status[i] != 0 || i % thorough(1, 6) != 0) return 0;
    snprintf(err, sizeof err, "%03d.record", i);
    const char *const args[] = {"record", name_of(wire, i, ".yaml"), "--stats", name_of(wire, i, ".json"), NULL};
    return wire_spawn(wire, args, "out", err, -1);
}

static void check_recording(const struct wire *wire, int i)
{
    if (status[i] != 0) {
        char *text = wire_read(name_of(wire, i, ".record"), NULL);
        fail_msg("%s: init took it, record ended with %d: %s", model[i], status[i], text);
    }
    char *json = wire_read(name_of(wire, i, ".json"), NULL);
    const char *points = strstr(json, "\"points\":");
    assert_non_null(points);
    if (strtol(points + strlen("\"points\":"), NULL, 10) == 0) fail_msg("%s: a scan without a point", model[i]);
    free(json);
}

static void each_is_scanned_or_refused(void **state)
{
    struct wire *wire = *state;
    int taken[MAX_MODELS], scanned = 0, n_taken = 0, single = 0, empty = 0, broken = 0;
    if (access("/usr/share/assimp/models", R_OK) != 0) {
        print_message("skipped: the models are not installed (Debian: assimp-testmodels)\n");
        skip();
    }
    assert_int_equal(nftw("/usr/share/assimp/models", take_file, 16, FTW_PHYS), 0);
    qsort(model, (size_t)n_models, sizeof *model, compare);
    run_all(wire, start_init);
    for (int i = 0; i < n_models; i++) {
        taken[i] = status[i] == 0;
        if (status[i] != 0 && status[i] != 2) fail_msg("%s: init ended with %d", model[i], status[i]);
        if (!taken[i]) check_reason(wire, i, &single, &empty, &broken);
    }
    run_all(wire, start_record);
    for (int i = 0; i < n_models; i++) {
        n_taken += taken[i];
        if (!taken[i] || i % thorough(1, 6) != 0) continue;
        check_recording(wire, i);
        scanned++;
    }
    printf(
        "# %d models: %d taken, %d of these scanned; refused: %d for single precision, %d without triangles, %d broken\n",
        n_models, n_taken, scanned, single, empty, broken);
    assert_true(scanned >= n_taken / 8); /* one in six, or all */
    assert_true(n_taken >= 100);         /* 101 of Debian 12's 140; Assimp of another version may read others */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(each_is_scanned_or_refused, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
