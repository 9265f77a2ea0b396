/* SPDX-License-Identifier: MIT */
/* Damaged IFC files, each with one change drawn from a seed. Both readers answer or are ended, and an error is one
 * line. Each product that the file's own records still have is there, or is reported. BROKEN_FILES=84 tries so many
 * files (default 8). The tests are skipped where npm has not installed the readers. */
#include "core/import/ifc/ifc_read.h"
#include "core/import/ifc/ifc_records.h"
#include "tests/unit/ifc_files.h"
#include "tests/unit/scene_files.h"

enum { SHAPES = 12 };

static char base[IFC_TEXT_ROOM], text[IFC_TEXT_ROOM];
static struct sh_err err;
static uint32_t state = 20261128;

static uint32_t draw(uint32_t n)
{
    state = state * 1664525u + 1013904223u;
    return (state >> 8) % n;
}

/* Returns one of the places in the data that have this text. */
static char *find(char *in, const char *what)
{
    uint32_t n = 0;
    for (char *at = in; (at = strstr(at, what)) != NULL; at++)
        n++;
    assert_true(n > 0);
    char *at = strstr(in, what);
    for (uint32_t i = draw(n); i > 0; i--)
        at = strstr(at + 1, what);
    return at;
}

static void replace(char *at, size_t n, const char *with)
{
    memmove(at + strlen(with), at + n, strlen(at + n) + 1);
    memcpy(at, with, strlen(with));
}

static const char *damage(char *data)
{
    static const char spice[] = "#()',;=$*.\\X09-E";
    static const char *const numbers[] = {"0.", "-1.", "1.E30", "1.E-30", "$", "NAN", "1.E400", "(0.)"};
    const size_t len = strlen(data);
    char *at;
    switch (draw(8)) {
    case 0:
        data[draw((uint32_t)len)] = '\0';
        return "cut off";
    case 1: /* a record goes */
        at = find(data, "\n#");
        replace(at, strcspn(at + 1, "\n") + 1, "");
        return "a record less";
    case 2: /* another reference */
        at = find(data, ",#") + 2;
        at[draw((uint32_t)strspn(at, "0123456789"))] = (char)('0' + draw(10));
        return "another reference";
    case 3:
        data[draw((uint32_t)len)] = spice[draw(sizeof spice - 1)];
        return "another byte";
    case 4: /* another number */
        at = find(data, ".,") + 1;
        while (strchr("0123456789.-", at[-1]) != NULL)
            at--;
        replace(at, strcspn(at, ",)"), numbers[draw(sizeof numbers / sizeof numbers[0])]);
        return "another number";
    case 5:
        replace(find(data, "IFCDIRECTION((") + 14, 2, "0.");
        return "another direction";
    case 6: /* another type */
        at = find(data, "=IFC") + 1;
        replace(at, strcspn(at, "("), "IFCSURFACEOFREVOLUTION");
        return "another type";
    default: /* a record twice */
        at = find(data, "\n#");
        memmove(at + strcspn(at + 1, "\n") + 1, at, strlen(at) + 1);
        return "a record twice";
    }
}

static bool is_in_scene(const struct scene *scene, const char *guid)
{
    for (uint32_t i = 0; i < scene->n_surfaces; i++)
        if (strstr(scene->surface[i].object, guid) != NULL) return true;
    return false;
}

/* Each product whose records have a body is in the scene, or was named. */
static void check_products(const struct scene *scene, const char *file)
{
    struct ifc_records records;
    if (ifc_records_open(&records, file, &err) != SH_OK) fail_msg("read, though its records are not: %s", err.text);
    for (size_t i = 0; i < records.n_products; i++) {
        const struct ifc_product *p = &records.product[i];
        if (!p->is_air && p->has_body && p->guid[0] != '\0' && !is_in_scene(scene, p->guid) &&
            strstr(warnings, p->guid) == NULL)
            fail_msg("'%s' %s went without a word; said:\n%s", p->name, p->guid, warnings);
    }
    ifc_records_close(&records);
}

static void nothing_goes_without_a_word(void **unused)
{
    (void)unused;
    char why[256];
    const char *wanted = getenv("BROKEN_FILES");
    const int n = wanted != NULL ? atoi(wanted) : 8;
    struct scene_import_limits limits = scene_import_defaults;
    int loaded = 0;
    if (!ifc_readers_are_there(&limits, why, sizeof why)) {
        print_message("%s\n", why);
        skip();
    }
    limits.time_s = 120; /* some files hang web-ifc; it is ended 10 s after ifc-lite, long before this */
    ifc_write_text(base, "IFC4", NULL, NULL, ifc_shapes, SHAPES, NULL);
    for (int i = 0; i < n; i++) {
        struct scene *scene = NULL;
        strcpy(text, base);
        const char *what = damage(strstr(text, "DATA;"));
        const struct scene_mesh_spec spec = {
            .file = write_text("broken.ifc", text), .up = SCENE_UP_Y, .scale = 1, .limits = &limits};
        const int rc = load_spec(&spec, 1.0, &scene, &err);
        print_message("%d: %s: %s\n", i, what, rc == SH_OK ? "read" : err.text);
        assert_true(rc == SH_OK || rc == SH_EINPUT);
        if (rc == SH_OK) check_products(scene, spec.file);
        if (rc != SH_OK) assert_null(strchr(err.text, '\n'));
        loaded += rc == SH_OK;
        scene_free(scene);
        unlink(spec.file);
    }
    print_message("%d of %d read\n", loaded, n);
    assert_true(loaded > 0 && loaded < n);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(nothing_goes_without_a_word)};
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
