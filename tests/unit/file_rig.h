/* SPDX-License-Identifier: MIT */
/* An empty file for a group of tests. */
#ifndef TESTS_UNIT_FILE_RIG_H
#define TESTS_UNIT_FILE_RIG_H

extern char file_path[];

/* For cmocka's group: make the file, and remove it. */
int make_file(void **state);
int remove_file(void **state);

#endif
