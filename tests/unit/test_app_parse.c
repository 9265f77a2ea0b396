/* SPDX-License-Identifier: MIT */
/* app_parse with a made-up table: each kind of option sets its value, and is refused beyond its limits; what the
 * command line says of files, keys and operands is kept in its order. */
#include "firmware_sim/app/app.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "tests/unit/output_rig.h"

struct values {
    int flag, quiet, calls;
    const char *text, *call;
    double number;
    long whole, fd;
    struct app_words words;
    int choice;
};

static const char *const WORDS[] = {"one", "two"}, *const SOLE[] = {"sole"};

static int take(void *values, const char *text)
{
    struct values *v = values;
    v->calls++;
    v->call = text;
    return APP_OK;
}

#define AT(member) offsetof(struct values, member)
/* clang-format off */
static const struct app_option OPTIONS[] = {
    {APP_FLAG, "flag", NULL, .letter = 'f', .at = AT(flag)},
    {APP_TEXT, "text", "T", .letter = 't', .at = AT(text)},
    {APP_NUMBER, "number", "N", .min = -1.5, .max = 2.5, .at = AT(number)},
    {APP_WHOLE, "whole", "N|all", .min = 1, .max = 9, .word = "all", .at = AT(whole)},
    {APP_OUTPUT, "fd", "N", .min = 1, .max = 99, .at = AT(fd)},
    {APP_KEY, "pace", "P", .key = "loop.pace"},
    {APP_KEY, "k", "P", .key = "k"},
    OPTION_SET,
    {APP_CALL, "call", "C", .apply = take, .file = APP_WRITES},
    {APP_PASS, "pass", "P", .at = AT(words)},
    {APP_PASS, "bare", NULL, .at = AT(words)},
    {APP_ALONE, "alone", "F", .apply = take, .file = APP_READS},
    {APP_PRINT, "print", NULL, .apply = take},
    {APP_FLAG, "quiet", NULL, .at = AT(quiet)},
    {APP_CHOICE, "choice", "W", .at = AT(choice), OPTION_CHOICES(WORDS)},
    {APP_CHOICE, "sole", "W", .at = AT(choice), OPTION_CHOICES(SOLE)},
    OPTION_END
};
/* clang-format on */

static const struct app_command command = {
    .name = "make", .operand = {"A", "B"}, .needs = "-x", .options = OPTIONS, .opens_links = 1};

static struct app_input in;
static struct values v;
static char line[70000];

/* Parses words that are apart by blanks. */
static int parse(const char *words)
{
    static char *argv[2 * APP_MAX_FILES + 16];
    char *at = line;
    int argc = 0;
    memset(&v, 0, sizeof v);
    snprintf(line, sizeof line, "make %s", words);
    for (char *word; (word = strsep(&at, " ")) != NULL;)
        argv[argc++] = word;
    argv[argc] = NULL;
    return app_parse(&command, argc, argv, &in, &v);
}

static void refuses(const char *words, const char *says)
{
    struct output output;
    output_take(&output, stderr);
    const int status = parse(words);
    char *said = output_give(&output);
    if (status != APP_USAGE || strcmp(said, says) != 0) fail_msg("%s: %d, %s", words, status, said);
    free(said);
}

static void each_kind_sets_its_value(void **state)
{
    (void)state;
    assert_int_equal(parse("a -f --text one b"), APP_GO_ON);
    assert_string_equal(in.operand[0], "a");
    assert_string_equal(in.operand[1], "b");
    assert_true(v.flag == 1 && v.quiet == 0 && in.n_options == 2 && in.alone == 0 && in.opens_links == 1);
    assert_string_equal(v.text, "one");
    assert_ptr_equal(in.options, OPTIONS);
    assert_true(app_is_given(&in, "flag") && app_is_given(&in, "text"));
    assert_false(app_is_given(&in, "number") || app_is_given(&in, "quiet") || app_is_given(&in, "nothing"));
    assert_int_equal(in.n_files, 2);
    for (int i = 0; i < 2; i++) {
        assert_string_equal(in.file[i].path, in.operand[i]);
        assert_true(in.file[i].use == APP_READS && in.file[i].option == NULL && in.file[i].is_given == 0);
    }
    assert_int_equal(parse("-tone -- -f b"), APP_GO_ON);
    assert_string_equal(in.operand[0], "-f");
    assert_true(v.flag == 0 && in.n_options == 1);
    assert_int_equal(parse("a b --call=x --call y"), APP_GO_ON);
    assert_int_equal(v.calls, 2);
    assert_string_equal(v.call, "y");
    assert_int_equal(in.n_files, 4); /* options come before operands */
    assert_string_equal(in.file[1].path, "y");
    assert_string_equal(in.file[1].option, "call");
    assert_true(in.file[1].use == APP_WRITES && in.file[1].is_given == 1);
    assert_int_equal(parse("--alone f --alone g"), APP_GO_ON);
    assert_true(in.alone == 1 && in.operand[0] == NULL && in.n_files == 2);
    assert_int_equal(parse("--print --nothing"), APP_OK); /* what comes after it doesn't count */
    assert_int_equal(v.calls, 1);
}

static void a_choice_is_one_of_its_words(void **state)
{
    (void)state;
    assert_int_equal(parse("a b --choice two"), APP_GO_ON);
    assert_int_equal(v.choice, 1);
    refuses("a b --choice three", "scanhead make: --choice three: allowed are one, two; see scanhead make --help\n");
    refuses("a b --sole two", "scanhead make: --sole two: allowed is sole; see scanhead make --help\n");
    refuses("a b --choice one --choice two",
            "scanhead make: --choice: given twice; one is allowed; see scanhead make --help\n");
}

static void numbers_keep_their_limits(void **state)
{
    static const char *const bad[] = {"-1.6", "2.6", "nan", "inf", "x", "", "1x", "\t1"};
    (void)state;
    assert_int_equal(parse("a b --number -1.5"), APP_GO_ON);
    assert_true(v.number == -1.5);
    assert_int_equal(parse("a b --number 2.5 --whole 1"), APP_GO_ON);
    assert_true(v.number == 2.5 && v.whole == 1);
    assert_int_equal(parse("a b --whole 9 --fd 2"), APP_GO_ON);
    assert_true(v.whole == 9 && v.fd == 2);
    assert_int_equal(parse("a b --whole all"), APP_GO_ON);
    assert_int_equal(v.whole, APP_WORD);
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        char words[64], says[160];
        snprintf(words, sizeof words, "a b --number=%s", bad[i]);
        snprintf(says, sizeof says,
                 "scanhead make: --number %s: not a number from -1.5 to 2.5; see scanhead make --help\n",
                 bad[i][0] != '\t' ? bad[i] : "?1");
        refuses(words, says);
    }
    static const char *const not_whole[] = {"0", "10", "1.5", "al"};
    for (size_t i = 0; i < sizeof not_whole / sizeof not_whole[0]; i++) {
        char words[64], says[160];
        snprintf(words, sizeof words, "a b --whole %s", not_whole[i]);
        snprintf(says, sizeof says,
                 "scanhead make: --whole %s: not a whole number from 1 to 9; see scanhead make --help\n", not_whole[i]);
        refuses(words, says);
    }
    refuses("a b --fd 98", "scanhead make: --fd 98: not open for writing; allowed is a descriptor that is, as with "
                           "98>FILE; see scanhead make --help\n");
}

/* A descriptor that can only be read is none to write to. */
static void a_descriptor_must_be_writable(void **state)
{
    (void)state;
    FILE *null = fopen("/dev/null", "r");
    char words[64];
    assert_non_null(null);
    snprintf(words, sizeof words, "a b --fd %d", fileno(null));
    struct output output;
    output_take(&output, stderr);
    assert_int_equal(parse(words), APP_USAGE);
    free(output_give(&output));
    fclose(null);
}

static void keys_are_settings(void **state)
{
    (void)state;
    assert_int_equal(parse("a b --pace fast --set x=1 --k 2"), APP_GO_ON);
    assert_int_equal(in.sets.n, 3);
    assert_string_equal(in.sets.set[0], "loop.pace=fast");
    assert_string_equal(in.sets.set[1], "x=1");
    assert_string_equal(in.sets.set[2], "k=2");
    /* Keys of options share 1024 bytes, each with its end: "k=", 1021 characters and a NUL are as many. */
    char words[1200] = "a b --k ";
    memset(words + 8, 'x', 1021);
    assert_int_equal(parse(words), APP_GO_ON);
    assert_int_equal(strlen(in.sets.set[0]), 1023);
    strcat(words, "x");
    refuses(words, "scanhead: k: the text is too long; all options that set keys share 1024 characters\n");
}

/* Returns the words "a b", and then n times `again`. */
static const char *repeated(const char *again, int n)
{
    static char words[8192];
    strcpy(words, "a b");
    for (int i = 0; i < n; i++)
        strcat(words, again);
    return words;
}

static void lists_have_an_end(void **state)
{
    (void)state;
    assert_int_equal(parse(repeated(" --set x=1", 256)), APP_GO_ON);
    assert_int_equal(in.sets.n, 256);
    refuses(repeated(" --set x=1", 257), "scanhead: too many settings; at most 256\n");
    assert_int_equal(parse(repeated(" --call f", 510)), APP_GO_ON); /* and two operands */
    assert_int_equal(in.n_files, 512);
    refuses(repeated(" --call f", 511), "scanhead: too many files; at most 512\n");
    refuses(repeated(" --call f", 513), "scanhead: too many files; at most 512\n");
}

static void words_are_passed_on(void **state)
{
    static const char *const want[] = {"--pass", "p", "--bare"};
    (void)state;
    assert_int_equal(parse("a b --pass p --bare"), APP_GO_ON);
    assert_true(v.words.n == 3 && v.words.n_names == 2);
    for (int i = 0; i < 3; i++)
        assert_string_equal(v.words.word[i], want[i]);
    refuses("a b --pass p --pass q", "scanhead make: --pass: given twice; one is allowed; see scanhead make --help\n");
    refuses("a b --text p -t q", "scanhead make: --text: given twice; one is allowed; see scanhead make --help\n");
}

/* Rows come after those that are there, in the order of the other command, and once only. */
static void rows_are_taken_from_another_command(void **state)
{
    static struct app_option rows[APP_MAX_OPTIONS + 1] = {{APP_FLAG, "own", NULL, .letter = 0}, OPTION_END};
    static const char *const choices[] = {"x", "y"};
    static const struct app_option other[] = {
        {APP_TEXT, "one", "W", .letter = 'o', .help = "h", .choices = choices, .n_choices = 2},
        {APP_FLAG, "two", NULL, .letter = 0},
        {APP_KEY, "three", "K", .key = "a.b"},
        OPTION_END};
    const struct app_command from = {.options = other};
    (void)state;
    for (int time = 0; time < 2; time++)
        app_pass_options(rows, &from, (const char *const[]){"three", "one", NULL}, 7);
    assert_string_equal(rows[0].name, "own");
    assert_string_equal(rows[1].name, "one");
    assert_string_equal(rows[2].name, "three");
    assert_int_equal(rows[3].kind, APP_LAST);
    assert_true(rows[1].kind == APP_PASS && rows[1].at == 7 && rows[1].letter == 0 && rows[1].n_choices == 2);
    assert_ptr_equal(rows[1].choices, choices);
    assert_string_equal(rows[1].argument, "W");
    assert_string_equal(rows[1].help, "h");
    assert_string_equal(rows[2].key, "a.b");
}

static void numbers_in_a_row(void **state)
{
    static const char *const bad[] = {"",      "1",     "1,2,", "1,2,3", "1;2",  ",2",
                                      "1,nan", "inf,1", "1,2 ", "0x1,2", "1,0X2"};
    double two[2];
    (void)state;
    assert_int_equal(app_read_numbers("1,-2.5", ',', two, 2), 1);
    assert_true(two[0] == 1.0 && two[1] == -2.5);
    assert_int_equal(app_read_numbers("3", ',', two, 1), 1);
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++)
        assert_int_equal(app_read_numbers(bad[i], ',', two, 2), 0);
}

static void the_nearest_word_is_meant(void **state)
{
    static const char *const known[] = {"start", "stats", "state"};
    char buf[64];
    (void)state;
    assert_string_equal(app_nearest("strat", known, 3), "start");
    assert_string_equal(app_nearest("statss", known, 3), "stats");
    assert_string_equal(app_nearest("stat", known, 3), "start"); /* the first of those that are as near */
    assert_null(app_nearest("stats", known, 0));
    assert_null(app_nearest("journal", known, 3));
    app_arguments(&command, buf, sizeof buf);
    assert_string_equal(buf, " A B -x [options]");
    app_arguments(&(struct app_command){.options = &OPTIONS[sizeof OPTIONS / sizeof OPTIONS[0] - 1]}, buf, sizeof buf);
    assert_string_equal(buf, "");
}

/* A command has nothing else to do for --quiet: its progress is that of these reports. */
static void quiet_hides_progress(void **state)
{
    (void)state;
    for (int quiet = 0; quiet < 2; quiet++) {
        struct output output;
        assert_int_equal(parse(quiet ? "a b --quiet" : "a b"), APP_GO_ON);
        assert_int_equal(v.quiet, quiet);
        output_take(&output, stderr);
        sh_progress(&app_report_stderr, "planning", 0.0);
        char *said = output_give(&output);
        assert_string_equal(said, quiet ? "" : "scanhead: planning: 0 %\n");
        free(said);
    }
    parse("a b");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_kind_sets_its_value),  cmocka_unit_test(a_choice_is_one_of_its_words),
        cmocka_unit_test(numbers_keep_their_limits), cmocka_unit_test(a_descriptor_must_be_writable),
        cmocka_unit_test(keys_are_settings),         cmocka_unit_test(lists_have_an_end),
        cmocka_unit_test(words_are_passed_on),       cmocka_unit_test(rows_are_taken_from_another_command),
        cmocka_unit_test(numbers_in_a_row),          cmocka_unit_test(the_nearest_word_is_meant),
        cmocka_unit_test(quiet_hides_progress),
    };
    return cmocka_run_group_tests_name("app_parse", tests, NULL, NULL);
}
