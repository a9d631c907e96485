// Its target owns the header that all tests share in compiled form (cmake/tests.cmake).
