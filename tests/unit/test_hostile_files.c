/* SPDX-License-Identifier: MIT */
/* Broken files of the formats that Assimp reads. Small models have bytes changed, lines deleted or doubled, numbers
 * made huge, records of another type, or are cut off. Each file either gives a scene or one line that names the error.
 * This process neither dies nor hangs, whatever happens to Assimp's.
 *
 * HOSTILE_EVERY: only every so many of the 600 files are tried (default 1, with sanitizers 30; make test-hostile:
 * 1). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/rng.h"
#include "core/scene.h"
#include "tests/common/thorough.h"
#include "tests/unit/hostile_models.h"

enum { N_FILES = 600, PROCESSES = 2, ROOM = 1 << 18 };

enum { USUAL_EVERY = SANITIZED ? 30 : 1 };

/* These limits are small for a broken model, and ten times what a sound one needs. The other readers of IFC, which take
 * a second each, have test_ifc_broken. */
static const struct scene_import_limits LIMITS = {
    .memory_mib = 128, .time_s = 2, .files = 16, .ifc_reader = IFC_READER_ASSIMP};

enum outcome { LOADED, REFUSED, DIED, TIME, MEMORY, OUTCOMES };
static const char *const OUTCOME[OUTCOMES] = {"loaded", "refused", "crashed Assimp", "time limit", "memory limit"};

static char folder[64];

/* ---- breaking */

struct draw {
    uint64_t key, n;
};

static uint64_t below(struct draw *d, uint64_t n)
{
    return rng_u64(d->key, d->n++) % n;
}

struct file {
    char *bytes;
    size_t n;
};

static void replace(struct file *f, size_t at, size_t len, const char *by, size_t by_len)
{
    if (f->n - len + by_len > ROOM) return;
    memmove(f->bytes + at + by_len, f->bytes + at + len, f->n - at - len);
    memcpy(f->bytes + at, by, by_len);
    f->n += by_len - len;
}

static void change_bytes(struct file *f, struct draw *d)
{
    for (uint64_t i = 1 + below(d, 6); i > 0 && f->n > 0; i--)
        f->bytes[below(d, f->n)] = (char)below(d, 256);
}

static bool is_text(const struct file *f)
{
    return memchr(f->bytes, '\0', f->n) == NULL;
}

/* Finds a line of a text, or some bytes of a binary file. */
static void find_part(const struct file *f, struct draw *d, size_t *at, size_t *len)
{
    *at = below(d, f->n);
    if (!is_text(f)) {
        *len = 1 + below(d, 64);
        if (*len > f->n - *at) *len = f->n - *at;
        return;
    }
    while (*at > 0 && f->bytes[*at - 1] != '\n')
        --*at;
    const char *end = memchr(f->bytes + *at, '\n', f->n - *at);
    *len = end != NULL ? (size_t)(end - f->bytes) + 1 - *at : f->n - *at;
}

static void delete_part(struct file *f, struct draw *d)
{
    size_t at, len;
    find_part(f, d, &at, &len);
    replace(f, at, len, "", 0);
}

static void double_part(struct file *f, struct draw *d)
{
    size_t at, len;
    find_part(f, d, &at, &len);
    char *copy = malloc(len + 1);
    memcpy(copy, f->bytes + at, len);
    replace(f, at, 0, copy, len);
    free(copy);
}

static void cut_off(struct file *f, struct draw *d)
{
    f->n = below(d, f->n);
}

static bool is_in(char c, const char *set)
{
    return c != '\0' && strchr(set, c) != NULL;
}

/* Finds the next run of characters of a set, from some place on. The run has 0 bytes where there is none. */
static size_t find_run(const struct file *f, struct draw *d, const char *set, size_t *at)
{
    size_t from = below(d, f->n), len = 0;
    for (size_t i = 0; i < f->n; i++) {
        *at = (from + i) % f->n;
        if (is_in(f->bytes[*at], set) && (*at == 0 || !is_in(f->bytes[*at - 1], set))) break;
    }
    while (*at + len < f->n && is_in(f->bytes[*at + len], set))
        len++;
    return len;
}

/* Changes a number, or four bytes of a binary file. */
static void change_number(struct file *f, struct draw *d)
{
    static const char *const texts[] = {"1e38", "4294967295", "-1", "nan", "x", "99999999999999999999", "1e-300", "0"};
    static const uint32_t values[] = {0xffffffff, 0x7fffffff, 0, 1, 0x7f800000, 0x10000000};
    size_t at;
    if (is_text(f)) {
        size_t len = find_run(f, d, "0123456789.", &at);
        const char *by = texts[below(d, sizeof texts / sizeof texts[0])];
        replace(f, at, len, by, strlen(by));
    } else if (f->n > 4) {
        memcpy(f->bytes + below(d, f->n - 4), &values[below(d, sizeof values / sizeof values[0])], 4);
    }
}

/* Puts a word of the file in the place of another: a record's type, an element's name. */
static void change_word(struct file *f, struct draw *d)
{
    static const char letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_";
    char word[64];
    size_t from, at, len = find_run(f, d, letters, &from);
    if (len >= sizeof word) len = sizeof word - 1;
    memcpy(word, f->bytes + from, len);
    size_t was = find_run(f, d, letters, &at);
    replace(f, at, was, word, len);
}

static void break_file(struct file *f, uint64_t number)
{
    static void (*const ways[])(struct file * f, struct draw * d) = {change_bytes,  delete_part, double_part,  cut_off,
                                                                     change_number, change_word, change_number};
    struct draw d = {rng_key(13, number), 0};
    for (uint64_t i = 1 + below(&d, 8) / 6; i > 0 && f->n > 1; i--) /* mostly one change: more are refused at once */
        ways[below(&d, sizeof ways / sizeof ways[0])](f, &d);
}

/* ---- loading */

static bool is_whole(const struct scene *s)
{
    for (uint32_t i = 0; i < s->n_triangles; i++)
        for (int c = 0; c < 3; c++)
            if (s->label[i] >= s->n_surfaces || s->triangle[i][c] >= s->n_vertices ||
                !isfinite(s->vertex_m[s->triangle[i][c]][0]))
                return false;
    return s->n_triangles > 0;
}

/* Returns -1 where the result is wrong. */
static int judge(int rc, const struct scene *s, const struct sh_err *err, const char *path)
{
    static const struct {
        const char *says;
        enum outcome outcome;
    } ends[] = {{"Assimp crashed while it read the file (SIG", DIED},
                {"ended without a message", DIED},
                {"was killed (SIGKILL)", DIED},
                {"did not read it within", TIME},
                {"needs more than", MEMORY}};
    if (rc == SH_OK) return is_whole(s) ? LOADED : -1;
    size_t len = strlen(path);
    if (rc != SH_EINPUT || strncmp(err->text, path, len) != 0 || strlen(err->text) < len + 8) return -1;
    for (const char *c = err->text; *c != '\0'; c++)
        if ((unsigned char)*c < ' ') return -1;
    for (size_t i = 0; i < sizeof ends / sizeof ends[0]; i++)
        if (strstr(err->text, ends[i].says) != NULL) return ends[i].outcome;
    return REFUSED;
}

/* A number of N_FILES and above is a whole file. */
static int try_file(uint64_t number)
{
    const struct hostile_model *model = hostile_model(number);
    char path[128];
    struct sh_err err = {0};
    struct scene *s = NULL;
    struct file f = {.bytes = malloc(ROOM), .n = model->n};
    memcpy(f.bytes, model->bytes, model->n);
    if (number < N_FILES) break_file(&f, number);
    snprintf(path, sizeof path, "%s/%u%s", folder, (unsigned)number, model->ending);
    FILE *out = fopen(path, "wb");
    size_t written = out != NULL ? fwrite(f.bytes, 1, f.n, out) : 0;
    if (out == NULL || fclose(out) != 0 || written != f.n) return -1;
    const struct scene_mesh_spec spec = {.file = path, .scale = 1, .textures = 1, .limits = &LIMITS};
    int rc = scene_load(&spec, 1, 1.0, NULL, &s, &err), outcome = judge(rc, s, &err, path);
    if (outcome < 0 || (number >= N_FILES && rc != SH_OK)) printf("# %s: code %d, '%s'\n", path, err.code, err.text);
    scene_free(s);
    unlink(path);
    free(f.bytes);
    return outcome;
}

/* ---- all of them, shared among processes; the death of one is a failure */

struct tally {
    unsigned n[HOSTILE_FORMATS][OUTCOMES], wrong;
};

static void work(struct tally *tally, unsigned process, unsigned every)
{
    unsigned nth = 0;
    for (unsigned number = 0; number < N_FILES; number++) {
        if (number / HOSTILE_FORMATS % every != 0 || nth++ % PROCESSES != process) continue;
        int outcome = try_file(number);
        if (outcome < 0)
            tally->wrong++;
        else
            tally->n[number % HOSTILE_FORMATS][outcome]++;
    }
}

static void show(const struct tally *tally)
{
    for (int f = 0; f < HOSTILE_FORMATS; f++) {
        printf("# %s:", hostile_format(f));
        for (int i = 0; i < OUTCOMES; i++) {
            unsigned sum = 0;
            for (int k = 0; k < PROCESSES; k++)
                sum += tally[k].n[f][i];
            printf("%s %u %s", i > 0 ? "," : "", sum, OUTCOME[i]);
        }
        printf("\n");
    }
}

static void broken_files(void **state)
{
    (void)state;
    const char *text = getenv("HOSTILE_EVERY");
    unsigned every = text != NULL && atoi(text) > 0 ? (unsigned)atoi(text) : USUAL_EVERY, wrong = 0;
    struct tally *tally =
        mmap(NULL, PROCESSES * sizeof *tally, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    pid_t pid[PROCESSES];
    int status;
    assert_true(tally != MAP_FAILED);
    if (!hostile_models_open()) {
        print_message("skipped: package assimp-testmodels is missing\n");
        skip();
    }
    strcpy(folder, "/tmp/scanhead-hostile-XXXXXX");
    assert_non_null(mkdtemp(folder));
    for (unsigned i = 0; i < 3 * HOSTILE_FORMATS; i++) /* up to three models of each format */
        assert_int_equal(try_file(N_FILES + i), LOADED);
    fflush(NULL);
    for (unsigned i = 0; i < PROCESSES; i++) {
        pid[i] = fork();
        if (pid[i] != 0) continue;
        work(&tally[i], i, every);
        fflush(NULL);
        _exit(0);
    }
    for (unsigned i = 0; i < PROCESSES; i++) {
        assert_int_equal(waitpid(pid[i], &status, 0), pid[i]);
        if (status != 0) fail_msg("process %u of the test ended with status %#x", i, (unsigned)status);
        wrong += tally[i].wrong;
    }
    show(tally);
    assert_int_equal(rmdir(folder), 0);
    assert_int_equal(wrong, 0);
    hostile_models_close();
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(broken_files)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
