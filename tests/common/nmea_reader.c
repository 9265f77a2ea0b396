/* SPDX-License-Identifier: MIT */
#include "tests/common/nmea_reader.h"

void read_line(const char *text, size_t len, const char *type, int n_fields, struct nmea_line *line)
{
    assert_true(len > 9 && len < sizeof line->text && text[0] == '$');
    memcpy(line->text, text, len);
    line->text[len] = '\0';
    assert_string_equal(line->text + len - 2, "\r\n");
    char *star = line->text + len - 5;
    assert_int_equal(*star, '*');
    int sum = 0;
    for (const char *p = line->text + 1; p < star; p++) {
        assert_true(*p >= 0x20 && *p < 0x7f && *p != '*' && *p != '$');
        sum ^= *p;
    }
    char hex[3] = {"0123456789ABCDEF"[sum / 16], "0123456789ABCDEF"[sum % 16]};
    assert_memory_equal(star + 1, hex, 2);
    *star = '\0';
    line->n = 0;
    for (char *p = line->text + 1; p != NULL && line->n < 32;) {
        line->field[line->n++] = p;
        p = strchr(p, ',');
        if (p != NULL) *p++ = '\0';
    }
    if (type[0] != '\0') assert_string_equal(line->field[0], type);
    if (n_fields != 0) assert_int_equal(line->n, n_fields);
}

double read_angle(const char *text, const char *letter, int degree_digits, const char letters[2])
{
    char degrees[4] = "";
    assert_true(strspn(text, "0123456789") == (size_t)degree_digits + 2);
    memcpy(degrees, text, (size_t)degree_digits);
    double minutes = strtod(text + degree_digits, NULL), deg = atoi(degrees) + minutes / 60;
    assert_true(minutes < 60);
    assert_true(letter[1] == '\0' && (letter[0] == letters[0] || letter[0] == letters[1]));
    return letter[0] == letters[0] ? deg : -deg;
}
