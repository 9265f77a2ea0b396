/* SPDX-License-Identifier: MIT */
/* Lines about products of an IFC file: each finding with its words, its count and the names, and errors where the
 * configuration is strict. */
#include <stdio.h>
#include <string.h>

#include "core/import/ifc/ifc_product.h"
#include "core/import/ifc/ifc_read.h"
#include "tests/common/cases.h"

enum { MANY = 130 };

static char warnings[8192];
static int n_warnings;

static void keep(void *ctx, const char *text)
{
    (void)ctx;
    n_warnings++;
    assert_true(strlen(warnings) + strlen(text) + 2 < sizeof warnings);
    strcat(strcat(warnings, text), "\n");
}

static const struct sh_report report = {.warn = keep};
static struct ifc_product product[MANY];
static size_t n_products;
static struct scene_build b = {.name = "house.ifc", .report = &report};
static struct sh_err err;

/* Products are walls with their numbers as names. */
static void begin(size_t n)
{
    static char names[MANY][16], guids[MANY][24];
    memset(product, 0, sizeof product);
    for (size_t i = 0; i < n; i++) {
        snprintf(names[i], sizeof names[i], "w%zu", i);
        snprintf(guids[i], sizeof guids[i], "0123456789abcdefgh%04zu", i);
        product[i] = (struct ifc_product){.id = i, .type = {"IFCWALLX", 7}, .name = names[i], .guid = guids[i]};
    }
    n_products = n;
    warnings[0] = '\0';
    n_warnings = 0;
}

#define WALL(i) "IFCWALL 'w" #i "' 0123456789abcdefgh000" #i

/* The words are those of core/import/ifc/README.md. Groups come in the order of their numbers. */
static void findings_are_grouped(void **state)
{
    (void)state;
    begin(6);
    product[1].finding = product[4].finding = IFC_OPEN;
    product[3].finding = IFC_LOST;
    product[5].finding = IFC_ONLY_LITE;
    assert_int_equal(ifc_say_findings(&b, product, n_products, false, &err), SH_OK);
    assert_string_equal(
        warnings, "house.ifc: 1 product: its records have a body, but neither reader makes one, so it is not in the "
                  "scene: " WALL(3) "\nhouse.ifc: 1 product: only ifc-lite makes a body, and this body is used: " WALL(
                      5) "\nhouse.ifc: 2 products: the body is open: " WALL(1) ", " WALL(4) "\n");
    begin(3);
    assert_int_equal(ifc_say_findings(&b, product, n_products, false, &err), SH_OK);
    assert_int_equal(ifc_say_findings(&b, product, n_products, true, &err), SH_OK);
    assert_int_equal(n_warnings, 0);
}

/* Strict files may have open bodies, and nothing else. The first product is named. */
static void strict_files_are_refused(void **state)
{
    (void)state;
    for (int f = IFC_AGREED; f < IFC_FINDINGS; f++) {
        begin(5);
        product[2].finding = f;
        const int doubtful = f != IFC_AGREED && f != IFC_OPEN && f != IFC_ANALYSIS;
        assert_int_equal(ifc_is_doubtful((enum ifc_finding)f), doubtful);
        assert_int_equal(ifc_say_findings(&b, product, n_products, true, &err), doubtful ? SH_EINPUT : SH_OK);
        assert_int_equal(n_warnings, f == IFC_OPEN || f == IFC_ANALYSIS);
        char want[512];
        snprintf(want, sizeof want, "house.ifc: 1 product: %s: " WALL(2) "; allowed none (scene.ifc_strict)",
                 f == IFC_AGREED ? "" : ifc_finding_text((enum ifc_finding)f));
        if (doubtful) assert_string_equal(err.text, want);
    }
    begin(5);
    product[4].finding = product[3].finding = IFC_UNCUT;
    assert_int_equal(ifc_say_findings(&b, product, n_products, true, &err), SH_EINPUT);
    assert_string_equal(err.text, "house.ifc: 2 products: no IfcRelVoidsElement says what it opens, so it opens "
                                  "nothing: " WALL(3) " and others; allowed none (scene.ifc_strict)");
}

/* Returns the number of the name that follows: names come in the order of products. */
static size_t next_name(const char **at, size_t i)
{
    char name[96];
    snprintf(name, sizeof name, "IFCWALL 'w%zu' 0123456789abcdefgh%04zu", i, i);
    const char *found = strstr(*at, name);
    if (found == NULL || found != strstr(*at, "IFCWALL")) fail_msg("%zu is not next in: %.80s", i, *at);
    *at = found + strlen(name);
    return i;
}

/* A hundred names are listed, over several lines. Each line is within the room of a warning. */
static void many_names_take_lines(void **state)
{
    (void)state;
    static const size_t n[] = {1, 100, 101, 130};
    for (size_t k = 0; k < sizeof n / sizeof n[0]; k++) {
        begin(n[k]);
        for (size_t i = 0; i < n[k]; i++)
            product[i].is_coarse = true;
        ifc_say_coarse(&b, product, n_products);
        char head[160];
        snprintf(head, sizeof head,
                 "house.ifc: %zu product%s: curved, with the body of ifc-lite, whose facets don't keep "
                 "scene.tolerance_m: IFCWALL 'w0' ",
                 n[k], n[k] > 1 ? "s" : "");
        assert_int_equal(strncmp(warnings, head, strlen(head)), 0);
        const char *at = warnings;
        const size_t listed = n[k] < 100 ? n[k] : 100;
        for (size_t i = 0; i < listed; i++)
            next_name(&at, i);
        char rest[64] = "\n";
        if (n[k] > 100) snprintf(rest, sizeof rest, ", and %zu more\n", n[k] - 100);
        assert_string_equal(at, rest);
        for (const char *line = warnings; *line != '\0'; line = strchr(line, '\n') + 1) {
            const size_t len = strcspn(line, "\n");
            assert_true(len <= 420 + 32); /* with the room for ", and N more" */
            assert_true(line == warnings || strncmp(line, "house.ifc: likewise: IFCWALL '", 30) == 0);
            assert_true(line[len + 1] == '\0' || len + sizeof ", " + 38 > 416); /* no further name found room */
        }
    }
}

/* Assimp's errors are known by entity: products that use one are named, or the file is refused. Openings are no
 * surfaces. */
static void known_errors_of_assimp(void **state)
{
    (void)state;
    begin(4);
    assert_int_equal(ifc_say_assimp(&b, product, n_products, true, "no reader is there", &err), SH_OK);
    product[0].assimp_wrong = product[1].assimp_wrong = (struct text_span){"IFCREVOLVED,", 10};
    product[3].assimp_wrong = (struct text_span){"IFCSWEPT", 8};
    product[0].is_air = true;
    assert_int_equal(n_warnings, 0);
    assert_int_equal(ifc_say_assimp(&b, product, n_products, false, "no reader is there", &err), SH_OK);
    assert_string_equal(warnings,
                        "house.ifc: 2 products: Assimp is known to read their shapes wrong, without a message: " WALL(
                            1) ", " WALL(3) "\n");
    assert_int_equal(ifc_say_assimp(&b, product, n_products, true, "no reader is there", &err), SH_EINPUT);
    assert_string_equal(
        err.text, "house.ifc: no reader is there, and Assimp is known to read IFCREVOLVE wrong, which 2 products use, "
                  "the first 'w1' 0123456789abcdefgh0001; scene.ifc_reader: assimp reads them in spite of that");
    assert_int_equal(n_warnings, 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(findings_are_grouped),
        cmocka_unit_test(strict_files_are_refused),
        cmocka_unit_test(many_names_take_lines),
        cmocka_unit_test(known_errors_of_assimp),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
