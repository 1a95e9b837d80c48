" Part 21 exchange files (STEP, STEP-NC).
if exists("b:current_syntax")
  finish
endif
syn keyword p21Section HEADER DATA ENDSEC ANCHOR REFERENCE SIGNATURE
syn match p21Section /\<\%(END-\)\=ISO-10303-21\>/
syn match p21Entity /\<!\=[A-Z][A-Z0-9_]*\ze\s*(/
syn match p21Number /[-+]\=\<\d\+\%(\.\d*\)\=\%(E[-+]\=\d\+\)\=/
syn match p21Definition /^\s*#\d\+\ze\s*=/
syn match p21Reference /#\d\+/
syn match p21Enumeration /\.[A-Z][A-Z0-9_]*\./
syn match p21Omitted /[$*]/
syn region p21String start=/'/ skip=/''/ end=/'/
syn region p21Comment start="/\*" end="\*/"
hi def link p21Section PreProc
hi def link p21Entity Type
hi def link p21Number Number
hi def link p21Definition Label
hi def link p21Reference Identifier
hi def link p21Enumeration Constant
hi def link p21Omitted Special
hi def link p21String String
hi def link p21Comment Comment
let b:current_syntax = "p21"
